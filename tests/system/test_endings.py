"""However a run ends, every process is gone within 2 s, no port is left, and one line says why."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from deploy.launch import rigs
from deploy.outcome.results import read_run
from deploy.recording.trajectory import CUT_OFF
from plant_server.session.record import STOPPED
from plant_server.spool.spool import read_spool
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import next_run_id, run_id
from protocol.wire.frames import TorqueFrame, decode
from tests.system.rig import (
    Process,
    Rig,
    alive,
    children_of,
    command_line,
    decmesh,
    eventually,
    recorded_ticks,
    said,
    twin_digest,
)

GONE_WITHIN_S = 2.0
SLOW_MACHINE_S = 10.0
"""Granted on top: the law is about what processes do, not about how fast this machine is."""


class Launched:
    """`decmesh run` of a long run, once it is under way."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "deploy", "run", "paper", "--out", str(folder)]
        self.launcher = subprocess.Popen(
            [*command, "--set", "run.duration_s=600"], stderr=subprocess.PIPE, text=True
        )
        eventually(lambda: len(children_of(self.launcher.pid)) == 4)
        spool = folder / "run.spool"
        eventually(lambda: recorded_ticks(spool))
        self.children = children_of(self.launcher.pid)

    def child(self, word: str) -> int:
        """The child with a word in its command line."""
        return next(pid for pid in self.children if word in command_line(pid))

    def all_gone(self) -> bool:
        return not any(map(alive, self.children))


@pytest.fixture
def launched(tmp_path: Path) -> Iterator[Launched]:
    run = Launched(tmp_path / "run")
    yield run
    run.launcher.kill()
    run.launcher.communicate()


def check_all_gone(launched: Launched) -> None:
    started = time.monotonic()
    eventually(launched.all_gone, GONE_WITHIN_S + SLOW_MACHINE_S)
    print(f"gone after {time.monotonic() - started:.2f} s")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it(launched: Launched, number: signal.Signals) -> None:
    launched.launcher.send_signal(number)
    _, errors = launched.launcher.communicate(timeout=30)
    assert launched.launcher.returncode == ExitCode.STOPPED
    assert errors.splitlines()[-1] == "stopped"
    assert "Traceback" not in errors
    check_all_gone(launched)
    assert not any(str(launched.folder) in file.read_text() for file in rigs.folder().iterdir())


def test_of_a_run_that_is_stopped_there_is_everything_until_then(launched: Launched) -> None:
    launched.launcher.send_signal(signal.SIGINT)
    _, errors = launched.launcher.communicate(timeout=30)
    summary_file, mcap = (launched.folder / name for name in ("summary.json", "run.mcap"))
    told = [f"{file}: the run until then" for file in (summary_file, mcap)]
    assert errors.splitlines()[-3:] == [*told, "stopped"]
    assert not (launched.folder / "run.spool").exists()
    summary = json.loads(summary_file.read_text())
    assert summary["ending"] == STOPPED
    replayed = decmesh("replay", str(mcap))
    assert replayed.stdout == f"identical: {summary['ticks']} ticks\n"


def test_a_killed_plant_leaves_what_it_had_recorded(launched: Launched) -> None:
    os.kill(launched.child("plant_server"), signal.SIGKILL)
    _, errors = launched.launcher.communicate(timeout=30)
    summary = json.loads((launched.folder / "summary.json").read_text())
    assert summary["ending"] == CUT_OFF
    told = f"the plant died; recorded are {summary['ticks']:,} ticks of the run"
    assert errors.splitlines()[-1] == told
    assert (launched.folder / "run.spool").exists(), "it may hold more than could be read"
    replayed = decmesh("replay", str(launched.folder / "run.mcap"))
    assert replayed.stdout.endswith("; the recording is incomplete\n")
    assert replayed.returncode == ExitCode.OK


def test_two_signals_end_it_no_worse(launched: Launched) -> None:
    launched.launcher.send_signal(signal.SIGINT)
    launched.launcher.send_signal(signal.SIGINT)
    _, errors = launched.launcher.communicate(timeout=30)
    assert launched.launcher.returncode == ExitCode.STOPPED
    assert "Traceback" not in errors
    check_all_gone(launched)


def test_a_killed_launcher_leaves_nobody_behind(launched: Launched) -> None:
    launched.launcher.kill()
    launched.launcher.communicate(timeout=30)
    check_all_gone(launched)


def test_a_killed_plant_ends_the_run(launched: Launched) -> None:
    os.kill(launched.child("plant_server"), signal.SIGKILL)
    _, errors = launched.launcher.communicate(timeout=30)
    assert launched.launcher.returncode == ExitCode.PEER_LOST
    assert "the plant" in errors
    check_all_gone(launched)


def test_boards_started_by_hand_wait_for_another_plant(make_rig: Callable[..., Rig]) -> None:
    """They begin anew with the plant that comes back, in a run with another name."""
    rig = make_rig("run.duration_s=0.3")
    first = rig.plant("--progress")
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    eventually(lambda: said(first))
    first.kill()
    eventually(lambda: all("the plant is gone" in said(board) for board in boards))
    second = rig.plant("--spool", str(rig.folder / "run.spool"))
    assert [process.wait(30) for process in (second, *boards)] == [0, 0, 0, 0]
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest("run.duration_s=0.3")
    answers = read_spool(rig.folder / "run.spool").ticks[-1].answers
    names = {decode(TorqueFrame, answer).run_id for answer in answers}
    assert names == {next_run_id(run_id(rig.scenario.digest))}
    assert decmesh("replay", str(rig.folder)).returncode == 0


def test_boards_started_by_hand_give_up_when_no_plant_comes_back(
    make_rig: Callable[..., Rig],
) -> None:
    rig = make_rig("run.duration_s=600")
    plant = rig.plant("--progress")
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    eventually(lambda: said(plant))
    plant.kill()
    assert [board.wait(60) for board in boards] == [ExitCode.PEER_LOST] * 3
    assert all("the plant did not come back" in said(board) for board in boards)
    eventually(rig.free)


def test_a_process_that_only_waits_can_be_stopped(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    waiting: list[Process] = [rig.plant(), rig.board("knee")]
    eventually(lambda: "waiting for" in said(waiting[0]))
    for process in reversed(waiting):  # A plant that ends sends its boards home.
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == ExitCode.STOPPED
    eventually(rig.free)
