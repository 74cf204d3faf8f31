"""Real processes by the wall clock: what holds on any machine, however slow and busy.

Nothing is said of how well it goes: a loaded machine may miss every deadline. The account has to be
right all the same. Links as heavy as these hardly move, whatever becomes of the torques, so a run
is not over before its time.
"""

import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from deploy.outcome.results import read_run
from deploy.recording.realtime_replay import replay
from deploy.recording.realtime_times import turns
from deploy.recording.spools import read_spool_of
from plant_server.session.pace import SLIP_S
from plant_server.spool.spool import PLANT, read_spool
from protocol.process.exit_codes import ExitCode
from protocol.robot.events import Departure
from protocol.wire.trace import TickTrace
from tests.system.rig import Launched, Rig, decmesh, eventually, said, twin_digest

HEAVY = [f"board.{board}.link.inertia_kg_m2=1e5" for board in range(3)]
SLOW = ["run.mode=realtime", "realtime.rate_hz=100", *HEAVY]


def options(*settings: str) -> list[str]:
    return [word for setting in settings for word in ("--set", setting)]


def burn() -> None:
    while True:
        pass


@contextmanager
def hogs(count: int) -> Iterator[None]:
    """Processes that leave the others as little as they can."""
    made = [multiprocessing.get_context("spawn").Process(target=burn) for _ in range(count)]
    for hog in made:
        hog.start()
    try:
        yield
    finally:
        for hog in made:
            hog.kill()
            hog.join()


def check_account(folder: Path, joints: tuple[str, ...] = ("ankle", "knee", "hip")) -> None:
    """Every deadline and every epoch is accounted for, and the run can be played again."""
    found = json.loads((folder / "summary.json").read_text())["realtime"]
    assert tuple(found["boards"]) == joints
    for board in found["boards"].values():
        assert board["in_time"] + board["late"] + board["skipped"] == board["periods"] > 0
        missed = (board["late"] + board["skipped"]) / board["periods"]
        assert board["missed_share"] == pytest.approx(missed)
        assert board["epochs_decided"] + board["epochs_missed"] == 20
        for key in ("period_ms", "wake_late_ms", "busy_ms", "observation_age_ms"):
            spread = board[key]
            assert 0.0 <= spread["p50"] <= spread["p99"] <= spread["max"]
    assert found["behind_ms_max"] >= 0.0
    assert (folder / "run.mcap").exists()
    assert not (folder / "run.spool").exists(), "it goes when the file is whole"
    played = replay(read_spool_of(folder))
    assert (played.differences, played.unplayed) == ((), 0)
    assert played.torques > 0


@pytest.mark.parametrize(("missed", "busy"), [("skip", 0), ("catch-up", 2)])
def test_the_account_is_right_and_the_run_can_be_played_again(
    tmp_path: Path, missed: str, busy: int
) -> None:
    settings = [*SLOW, "run.duration_s=2", f"realtime.missed={missed}"]
    with hogs(busy):
        done = decmesh("run", "paper", *options(*settings), "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    assert "Traceback" not in done.stderr
    assert "Realtime; median" in done.stdout
    run = read_run(tmp_path / "run")
    assert run is not None
    assert (run.ticks, run.ending) == (2000, "complete")
    assert run.wall_s > 2.0 - SLIP_S - 0.01, "no faster than the wall clock"
    check_account(tmp_path / "run")
    replayed = decmesh("replay", str(tmp_path / "run"))
    assert replayed.stdout.startswith("identical: 2000 ticks, "), replayed.stdout


def test_boards_may_differ_and_the_option_is_the_mode(tmp_path: Path) -> None:
    rates = ["board.0.rate_hz=50", "board.1.rate_hz=100", "board.2.rate_hz=200"]
    settings = [*HEAVY, *rates, "run.duration_s=2", "election.rounds=2", "election.period_s=0.2"]
    folder = tmp_path / "run"
    done = decmesh(
        "run", "paper", "--realtime", *options(*settings), "--json", "--out", str(folder)
    )
    assert done.returncode == ExitCode.OK, done.stderr
    boards = json.loads(done.stdout)["realtime"]["boards"]
    assert [board["rate_hz"] for board in boards.values()] == [50.0, 100.0, 200.0]
    played = replay(read_spool_of(folder))
    assert (played.differences, played.unplayed) == ((), 0)


def test_a_host_that_is_too_slow_says_by_how_much_and_finishes(tmp_path: Path) -> None:
    """The body in 400 steps a tick: nobody's Python integrates that in a millisecond."""
    settings = [*SLOW, "run.duration_s=0.2", "run.substeps=400"]
    done = decmesh("run", "paper", *options(*settings), "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    assert "plant: the host is too slow for realtime: " in done.stderr
    assert "The host was too slow for this: " in " ".join(done.stdout.split())
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["ending"], summary["ticks"]) == ("complete", 200)
    assert summary["realtime"]["slipped_s"] > 0.1


def test_started_by_hand_in_an_odd_order(make_rig: Callable[..., Rig], tmp_path: Path) -> None:
    """The scenario says which mode it is, to every process alike."""
    rig = make_rig(*SLOW, "run.duration_s=0.5")
    hip = rig.board("hip")
    plant = rig.plant("--spool", str(tmp_path / "run.spool"))
    eventually(lambda: "waiting for ankle, knee" in said(plant))
    others = [rig.board("ankle"), rig.board("knee")]
    assert [process.wait(30) for process in (plant, *others, hip)] == [0, 0, 0, 0]
    spool = read_spool(tmp_path / "run.spool")
    assert {board for board, _ in spool.realtime} == {0, 1, 2, PLANT}
    assert replay(spool).differences == ()


def periods_per_slot(own: list[TickTrace]) -> float:
    """Own periods that go by, on the board's own clock, while the plant's ticks fill one."""
    due_us = [turn.woke_us - turn.late_us for turn in own]
    return (due_us[-1] - due_us[0]) / 10_000 / (own[-1].slot - own[0].slot)


def test_a_clock_that_is_fast_runs_fast(tmp_path: Path) -> None:
    """By a hundredth, against one that is slow by as much, whatever the plant's pace was."""
    folder = tmp_path / "run"
    skews = ["board.0.clock.skew_ppm=10000", "board.2.clock.skew_ppm=-10000"]
    settings = [*SLOW, "run.duration_s=3", *skews]
    done = decmesh("run", "paper", *options(*settings), "--out", str(folder))
    assert done.returncode == ExitCode.OK, done.stderr
    spool = read_spool_of(folder)
    ankle, _knee, hip = (periods_per_slot(life) for (life,) in turns(spool))
    assert ankle / hip == pytest.approx(1.02, abs=0.008)
    assert replay(spool).differences == ()


@pytest.fixture
def launched(tmp_path: Path) -> Iterator[Launched]:
    run = Launched(tmp_path / "run", *options(*SLOW))
    yield run
    run.kill()


def driving(run: Launched, joint: str, incarnation: int) -> bool:
    board = run.board(joint)
    return board["incarnation"] >= incarnation and board["state"] not in ("absent", "syncing")


def test_commands_deaths_and_a_frozen_board(launched: Launched) -> None:
    """All of it while the body moves, and all of it is played again to the bit."""
    run = launched
    eventually(lambda: all(board["periods"] for board in run.status()["realtime"]))
    assert "torque age" in run.ask("status").stdout
    assert run.ask("cut", "ankle-knee").returncode == ExitCode.OK
    eventually(lambda: run.board("ankle")["state"] in ("reckoning", "safe"))
    assert run.ask("heal").returncode == ExitCode.OK
    assert run.ask("push", "5N", "--for", "20ms").returncode == ExitCode.OK
    os.kill(run.pid("knee"), signal.SIGKILL)
    eventually(lambda: run.board("knee")["state"] == "absent")
    assert run.ask("plug", "knee").returncode == ExitCode.OK
    eventually(lambda: driving(run, "knee", 2))
    assert run.ask("unplug", "hip").returncode == ExitCode.OK
    eventually(lambda: run.board("hip")["state"] == "absent")
    frozen = run.pid("ankle")
    os.kill(frozen, signal.SIGSTOP)
    eventually(lambda: run.board("ankle")["state"] == "absent")
    tick = run.status()["tick"]
    eventually(lambda: run.status()["tick"] > tick + 100)
    os.kill(frozen, signal.SIGCONT)
    eventually(lambda: driving(run, "ankle", 2))
    run.launcher.send_signal(signal.SIGINT)
    _, errors = run.launcher.communicate(timeout=30)
    assert run.launcher.returncode == ExitCode.STOPPED
    assert "Traceback" not in errors
    assert "run.mcap: the run until then" in errors
    spool = read_spool_of(run.folder)
    gone = [
        event.board
        for record in spool.ticks
        for event in record.events
        if isinstance(event, Departure)
    ]
    assert {0, 1, 2} <= set(gone)
    assert replay(spool).differences == ()


@pytest.mark.parametrize("pace", ["1", "0.5"])
def test_a_pace_changes_nothing_but_the_wall_time(tmp_path: Path, pace: str) -> None:
    settings = ("run.duration_s=0.4",)
    folder = tmp_path / "run"
    done = decmesh("run", "paper", *options(*settings), "--pace", pace, "--out", str(folder))
    assert done.returncode == ExitCode.OK, done.stderr
    run = read_run(folder)
    assert run is not None
    assert run.wall_s > 0.4 / float(pace) - SLIP_S - 0.01, "it may have been late for tick 0"
    assert run.state_sha256 == twin_digest(*settings)


def test_a_scenario_may_have_a_pace(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig("run.duration_s=0.2", "run.pace=0.5")
    plant = rig.plant("--progress", "--spool", str(rig.folder / "run.spool"))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    assert [process.wait(30) for process in (plant, *boards)] == [0, 0, 0, 0]
    run = read_run(rig.folder)
    assert run is not None
    assert run.wall_s > 0.4 - SLIP_S - 0.01
    assert run.state_sha256 == twin_digest("run.duration_s=0.2")


@pytest.mark.parametrize(
    "words", [["--realtime", "--twin"], ["--realtime", "--pace", "1"], ["--twin", "--pace", "1"]]
)
def test_what_has_no_wall_clock_cannot_follow_it(tmp_path: Path, words: list[str]) -> None:
    done = decmesh("run", "paper", *words, "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.BAD_INPUT
    assert not (tmp_path / "run").exists()
