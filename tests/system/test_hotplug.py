"""Boards that die, freeze, are pulled and put back: real processes, and what becomes of a run."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from deploy.outcome.results import read_run
from deploy.recording.trajectory import Trajectory
from protocol.process.exit_codes import ExitCode
from protocol.robot.events import Admission, LinkChange, LinkRepair, Push, Sides, tag_of
from protocol.robot.states import State
from tests.system.rig import (
    Launched,
    Process,
    Rig,
    decmesh,
    eventually,
    said,
    twin_digest,
)

SHORT = {
    "hotplug": ("event.0.at_s=0.2", "event.1.at_s=0.35", "run.duration_s=0.6"),
    "knee-out": ("event.0.at_s=0.2", "event.1.at_s=0.35", "run.duration_s=0.6"),
    "storm": (
        "event.0.at_s=0.05",
        "event.1.at_s=0.1",
        "event.2.at_s=0.2",
        "event.3.at_s=0.3",
        "event.4.at_s=0.4",
        "event.5.at_s=0.5",
        "run.duration_s=0.8",
    ),
}


@pytest.mark.parametrize("scenario", SHORT)
def test_scheduled_deaths_of_real_processes_equal_the_twin(tmp_path: Path, scenario: str) -> None:
    """The process is really killed, a new one really started, in the same tick as in the twin."""
    options = [word for setting in SHORT[scenario] for word in ("--set", setting)]
    done = decmesh("run", scenario, *options, "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    run = read_run(tmp_path / "run")
    assert run is not None
    assert {"unplug", "plug", "gone", "admitted"} <= {tag_of(event) for _, event in run.events}
    assert run.state_sha256 == twin_digest(*SHORT[scenario], source=scenario)


def ended(run: Launched) -> tuple[Trajectory, str]:
    """Stop the run; what was recorded, and what was said."""
    run.launcher.send_signal(signal.SIGINT)
    _, errors = run.launcher.communicate(timeout=30)
    assert "Traceback" not in errors
    recorded = read_run(run.folder)
    assert recorded is not None
    return recorded, errors


@pytest.fixture
def launch(tmp_path: Path) -> Iterator[Callable[..., Launched]]:
    made: list[Launched] = []

    def make(*options: str) -> Launched:
        made.append(Launched(tmp_path / "run", *options))
        return made[-1]

    yield make
    for run in made:
        run.kill()


def happened(run: Trajectory, what: str) -> list[tuple[int, Any]]:
    return [(tick, event) for tick, event in run.events if tag_of(event) == what]


def test_a_killed_board_is_named_and_the_run_goes_on(launch: Callable[..., Launched]) -> None:
    run = launch()
    os.kill(run.pid("knee"), signal.SIGKILL)
    eventually(lambda: run.board("knee")["state"] == "absent")
    tick = run.status()["tick"]
    eventually(lambda: run.status()["tick"] > tick + 100)
    recorded, errors = ended(run)
    ((died, event),) = happened(recorded, "gone") + happened(recorded, "gone_midway")
    assert (event.board, event.why) == (1, "died")
    assert "knee died at tick" in errors
    assert not recorded.state[died + 1 :, 1].any(), "nobody drives the knee any more"
    assert happened(recorded, "sides")[0][1] == Sides(((0,), (2,)))


def test_boards_are_pulled_and_put_back_from_a_terminal(launch: Callable[..., Launched]) -> None:
    run = launch()
    assert run.ask("unplug", "hip").returncode == ExitCode.OK
    eventually(lambda: run.board("hip")["state"] == "absent")
    again = run.ask("unplug", "hip")
    assert again.returncode == ExitCode.REFUSED
    assert again.stderr == "hip is not plugged in\n"
    assert run.ask("plug", "hip").returncode == ExitCode.OK
    eventually(lambda: run.board("hip")["state"] == "running")
    recorded, _ = ended(run)
    assert [event for _, event in happened(recorded, "admitted")][-1] == Admission(2, 2)


def test_a_board_started_by_hand_takes_the_place_of_a_dead_one(
    launch: Callable[..., Launched],
) -> None:
    run = launch()
    os.kill(run.pid("knee"), signal.SIGKILL)
    eventually(lambda: run.board("knee")["state"] == "absent")
    scenario = str(run.folder / "scenario.json")
    command = [sys.executable, "-m", "module_agent", "knee", "--scenario", scenario]
    board = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    eventually(lambda: run.board("knee")["state"] == "running")
    ended(run)
    _, errors = board.communicate(timeout=30)
    assert board.returncode == ExitCode.OK
    assert "Traceback" not in errors


def test_links_are_cut_and_healed_from_a_terminal(launch: Callable[..., Launched]) -> None:
    run = launch()
    assert run.ask("cut", "ankle-knee").returncode == ExitCode.OK
    eventually(lambda: run.board("ankle")["state"] == "reckoning")
    assert run.ask("heal").returncode == ExitCode.OK
    eventually(lambda: run.board("ankle")["state"] == "running")
    assert run.ask("cut", "--one-way", "knee-ankle").returncode == ExitCode.OK

    def deaf() -> list[tuple[str, str]]:
        return [(link["from"], link["to"]) for link in run.status()["links"] if link["one_way"]]

    eventually(lambda: deaf() == [("knee", "ankle")])
    assert run.ask("loss", "0.2", "knee-hip").returncode == ExitCode.OK
    assert run.ask("delay", "3ms", "knee-hip").returncode == ExitCode.OK
    pushed = json.loads(run.ask("push", "5N", "--for", "20ms", "--json").stdout)
    assert set(pushed) == {"tick", "at_s"}
    assert run.ask("reference", "hip", "1deg").returncode == ExitCode.OK
    assert run.ask("cut", "ankle-hip").returncode == ExitCode.BAD_INPUT
    recorded, _ = ended(run)
    commands = [
        event for _, event in recorded.events if isinstance(event, LinkChange | LinkRepair | Push)
    ]
    assert commands[0] == LinkChange(((0, 1), (1, 0)), {"cut": 1.0})
    ((tick, _),) = happened(recorded, "push")
    assert tick >= pushed["tick"] == round(pushed["at_s"] * 1000)
    assert happened(recorded, "sides")[0][1] == Sides(((0,), (1, 2)))


def test_a_frozen_board_is_waited_for_by_name(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig("run.duration_s=3")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--progress", "--spool", str(spool))
    boards = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: said(plant))
    boards["knee"].send_signal(signal.SIGSTOP)
    eventually(lambda: "waits for knee" in said(plant))
    boards["knee"].send_signal(signal.SIGCONT)
    processes: list[Process] = [plant, *boards.values()]
    assert [process.wait(60) for process in processes] == [0, 0, 0, 0]
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest("run.duration_s=3"), "waiting changes nothing"


def test_a_plant_that_is_paused_in_a_debugger_is_waited_for(make_rig: Callable[..., Rig]) -> None:
    """No clock on any wall ends a run in lockstep, nor changes it."""
    rig = make_rig("run.duration_s=3")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--progress", "--spool", str(spool))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    eventually(lambda: said(plant))
    plant.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    assert all(board.poll() is None for board in boards)
    plant.send_signal(signal.SIGCONT)
    assert [process.wait(60) for process in (plant, *boards)] == [0, 0, 0, 0]
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest("run.duration_s=3")


def test_with_patience_a_frozen_board_is_left_behind_and_enrols_again(
    make_rig: Callable[..., Rig],
) -> None:
    rig = make_rig("run.duration_s=600", "unattended.how=braked")
    plant = rig.plant("--progress", "--patience", "200ms")
    boards = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: said(plant))
    boards["knee"].send_signal(signal.SIGSTOP)
    eventually(lambda: "knee was silent for too long; going on without it" in said(plant))
    lines = len(said(plant).splitlines())
    eventually(lambda: len(said(plant).splitlines()) > lines)
    time.sleep(0.2)
    boards["knee"].send_signal(signal.SIGCONT)
    eventually(lambda: "enrolling again" in said(boards["knee"]))
    base_port = rig.scenario.rig.base_port

    def state() -> str:
        now = json.loads(decmesh("status", "--json", "--rig", f"127.0.0.1:{base_port}").stdout)
        return str(now["boards"][1]["state"])

    eventually(lambda: state() == State.RUNNING.name.lower())
    plant.send_signal(signal.SIGINT)
    assert [board.wait(30) for board in boards.values()] == [ExitCode.OK] * 3


def test_processes_equal_the_twin_on_hardware_that_fails(tmp_path: Path) -> None:
    """Noise, steps, lags, late ticks, a foot, a board that takes its time, and broken sensors."""
    events = (
        "event=[{at_s=0.05, do='sensor', joint='knee', fault='stuck', duration_s=0.05},"
        "{at_s=0.1, do='sensor', joint='hip', sensor='imu', fault='garbage', duration_s=0.03},"
        "{at_s=0.15, do='sensor', joint='ankle', sensor='all', fault='intermittent'},"
        "{at_s=0.2, do='unplug', joint='hip'}, {at_s=0.25, do='plug', joint='hip'}]"
    )
    late = "board.1.clock.overrun_at_s=[0.1, 0.101, 0.102]"
    settings = (events, late, "run.duration_s=0.6", "unattended.how=braked", "run.seed=7")
    options = [word for setting in settings for word in ("--set", setting)]
    done = decmesh("run", "hardware", *options, "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    run = read_run(tmp_path / "run")
    assert run is not None
    assert {"sensor", "ready", "admitted"} <= {tag_of(event) for _, event in run.events}
    assert run.state_sha256 == twin_digest(*settings, source="hardware")
