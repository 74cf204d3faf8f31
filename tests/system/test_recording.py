"""What a run of real processes leaves behind, and that a recording never gets in its way (S22)."""

import os
import resource
import signal
from collections.abc import Callable
from itertools import pairwise

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.results import read_run
from deploy.scenario_file.load import load
from plant_server.session.record import STOPPED, Outcome, TickRecord
from plant_server.spool.spool import Spool, read_spool
from protocol.process.exit_codes import ExitCode
from protocol.process.fingerprint import fingerprint
from protocol.process.machine import clock_id
from protocol.wire.timing import Timing
from protocol.wire.wiring import neighbours
from tests.system.rig import Process, Rig, eventually, recorded_ticks, said, twin_digest

FLOOR_NS = 1000
"""Boards tell whole microseconds."""
Key = tuple[int, int]
"""A board and a tick."""


class BoardTimes:
    """What boards told of every tick, in nanoseconds."""

    def __init__(self, timings: list[tuple[int, Timing]], boards: int) -> None:
        self.taken_up: dict[Key, int] = {}
        self.decided: dict[Key, int] = {}
        self.said: dict[Key, int] = {}
        self.arrived: dict[tuple[int, int, int], int] = {}
        """By sender, receiver and the tick in which the frame was used."""
        for board, frame in timings:
            for tick, entry in enumerate(frame.ticks, start=frame.tick):
                assert (board, tick) not in self.said, "told once"
                up, decided, said, *arrivals = (frame.base_ns + us * 1000 for us in entry)
                self.taken_up[board, tick] = up
                self.decided[board, tick] = decided
                self.said[board, tick] = said
                senders = neighbours(board, boards)
                assert set(entry[3 + len(senders) :]) <= {-1}
                for sender, us, ns in zip(senders, entry[3:], arrivals, strict=False):
                    if us != -1:
                        self.arrived[sender, board, tick] = ns


def test_a_recording_tells_when_everything_happened(make_rig: Callable[..., Rig]) -> None:
    """On one machine all clocks are one, so causes come before effects across processes as well."""
    settings = ("run.duration_s=0.6",)
    rig = make_rig(*settings)
    plant = rig.plant("--spool", str(rig.folder / "run.spool"))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    assert [process.wait(60) for process in (plant, *boards)] == [0, 0, 0, 0]
    spool = read_spool(rig.folder / "run.spool")
    assert spool.complete
    assert spool.facts["mode"] == "processes"
    assert spool.facts["fingerprint"] == fingerprint()
    assert spool.facts["reports_refused"] == {}
    assert spool.facts["cpu_s"] > 0.0
    assert {frame.clock for _, frame in spool.timings} == {clock_id()} == {spool.facts["clock"]}
    check_times(spool)
    check_efforts(spool)
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest(*settings), "to record changes nothing"


def check_times(spool: Spool) -> None:
    told = BoardTimes(spool.timings, 3)
    ticks = [record.tick for record in spool.ticks]
    first = ticks[0]
    assert set(told.said) == {(board, tick) for board in range(3) for tick in ticks}
    for tick, walls in zip(ticks, spool.walls, strict=True):
        assert walls is not None
        for board in range(3):
            key = board, tick
            assert walls.opened_ns <= told.taken_up[key] + FLOOR_NS
            assert told.taken_up[key] <= told.decided[key] <= told.said[key]
            assert told.decided[key] <= walls.answered_ns[board] <= walls.closed_ns
    for before, after in pairwise(spool.walls):
        assert before is not None
        assert after is not None
        assert before.closed_ns <= after.opened_ns
    links = [(0, 1), (1, 0), (1, 2), (2, 1)]
    # In the first tick nobody has heard anything; from then on every frame is here.
    expected = {(*link, tick) for link in links for tick in ticks if tick > first}
    assert set(told.arrived) == expected
    for (sender, receiver, tick), arrived_ns in told.arrived.items():
        assert told.decided[sender, tick - 1] <= arrived_ns + FLOOR_NS
        assert arrived_ns <= told.decided[receiver, tick]


def check_efforts(spool: Spool) -> None:
    """Of each board they only grow, and there is a Python and a network in them."""
    for board in range(3):
        frames = [frame for of, frame in spool.timings if of == board]
        assert all(
            earlier.cpu_us <= later.cpu_us and earlier.memory_kb <= later.memory_kb
            for earlier, later in pairwise(frames)
        )
        assert 10_000 < frames[-1].cpu_us < 600e6
        assert 10_000 < frames[-1].memory_kb < 1_000_000


def check_beginning(recorded: list[TickRecord]) -> Outcome:
    """What could be read is the beginning of a run that the twin has; how that one ended."""
    ticks = recorded[-1].tick + 1
    twin, outcome = run_twin(load("paper", [f"run.duration_s={ticks / 1000}"]))
    assert [record[:4] for record in recorded] == [record[:4] for record in twin]
    return outcome


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_ends_between_two_ticks(
    make_rig: Callable[..., Rig], number: signal.Signals
) -> None:
    """Its last state is one that the twin has as well, and boards have told of all its ticks."""
    rig = make_rig("run.duration_s=600")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--spool", str(spool))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    eventually(lambda: recorded_ticks(spool) > 100)
    plant.send_signal(number)
    assert plant.wait(30) == ExitCode.STOPPED
    assert [board.wait(30) for board in boards] == [0, 0, 0]
    back = read_spool(spool)
    assert back.complete
    assert back.outcome is not None
    assert back.outcome.ending == STOPPED
    twin = check_beginning(back.ticks)
    assert back.outcome[:3] == twin[:3]
    told = set(BoardTimes(back.timings, 3).said)
    recorded = {(board, record.tick) for board in range(3) for record in back.ticks}
    open_tick = {(board, twin.tick) for board in range(3)}
    assert recorded <= told <= recorded | open_tick


def test_a_full_disk_ends_the_recording_and_not_the_run(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig("run.duration_s=3")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--spool", str(spool))
    room = 400_000  # For one chunk, but not for two.
    resource.prlimit(plant.pid, resource.RLIMIT_FSIZE, (room, room))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    assert [process.wait(60) for process in (plant, *boards)] == [0, 0, 0, 0]
    told = [line for line in said(plant).splitlines() if "recording" in line]
    assert len(told) == 1
    assert told[0].startswith("plant: recording stopped at tick ")
    assert told[0].endswith(": File too large; the run goes on")
    assert "complete after 3000 ticks" in said(plant)
    back = read_spool(spool)
    assert not back.complete
    assert back.outcome is None
    check_beginning(back.ticks)


def test_a_killed_plant_leaves_what_it_has_written(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig("run.duration_s=600")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--spool", str(spool))
    for joint in rig.scenario.joints:
        rig.board(joint)
    eventually(lambda: recorded_ticks(spool) > 100)
    before = recorded_ticks(spool)
    os.kill(plant.pid, signal.SIGKILL)
    plant.wait()
    back = read_spool(spool)
    assert len(back.ticks) >= before
    assert None not in back.walls
    assert not back.complete
    check_beginning(back.ticks)


def test_a_plant_that_waits_for_a_frozen_board_has_recorded_all_that_was(
    make_rig: Callable[..., Rig],
) -> None:
    """A chunk is not kept back until it is full: nobody knows what comes next."""
    rig = make_rig("run.duration_s=600")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--progress", "--spool", str(spool))
    boards: dict[str, Process] = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: said(plant))
    boards["hip"].send_signal(signal.SIGSTOP)
    eventually(lambda: "waits for hip" in said(plant))
    line = next(line for line in said(plant).splitlines() if "waits for hip" in line)
    waiting_tick = int(line.split()[2])
    eventually(lambda: read_spool(spool).ticks[-1].tick == waiting_tick - 1)
