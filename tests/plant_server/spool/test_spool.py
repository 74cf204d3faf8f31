"""The spool gives back what was appended, up to the chunk in which it was cut off."""

import errno
import os
import random
import resource
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import pi
from pathlib import Path

import pytest

from deploy.scenario_file.load import load
from plant_server.session.record import (
    COMPLETE,
    FELL,
    Outcome,
    TickRecord,
    TickWallTimes,
    UndrivenJoint,
)
from plant_server.spool import chunks, spool
from plant_server.spool.spool import SpoolWriter, read_spool
from protocol.robot.events import Departure, Event, Push, Sides
from protocol.wire.frames import encode
from protocol.wire.timing import TickTiming, Timing

SCENARIO = load("paper", [f"run.seed={2**62}"])
OUTCOME = Outcome(
    12,
    (0.1, -0.2, pi),
    (1e-300, 0.0, -5.5),
    COMPLETE,
    0.25,
    (
        UndrivenJoint("knee", -3, "braked", has_board=False),
        UndrivenJoint("hip", 7, "limp", has_board=True),
    ),
)


def records(count: int, *, seed: int = 1) -> list[TickRecord]:
    """Ticks from -2 on: numbers of every size, answers of any bytes, all sorts of events."""
    rng = random.Random(seed)

    def numbers() -> tuple[float, ...]:
        return tuple(rng.uniform(-1.0, 1.0) * 10.0 ** rng.randint(-300, 300) for _ in range(3))

    def answers() -> tuple[bytes, ...]:
        return tuple(rng.randbytes(rng.randint(0, 30)) for _ in range(3))

    def events(tick: int) -> tuple[Event, ...]:
        if tick % 3:
            return ()
        return Push(2, 40.0, tick + 3), Sides(((0,), (1, 2))), Departure(1, "died")

    return [
        TickRecord(tick, numbers(), numbers(), numbers(), answers(), events(tick))
        for tick in range(-2, count - 2)
    ]


def write(path: Path, ticks: list[TickRecord], outcome: Outcome = OUTCOME) -> SpoolWriter:
    writer = SpoolWriter(path, SCENARIO)
    for tick in ticks:
        writer.append(tick, None)
    writer.close(outcome)
    return writer


def eventually(condition: Callable[[], object]) -> None:
    """Wait for the thread that writes."""
    deadline = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.001)


@contextmanager
def a_small_disk(path: Path, more_bytes: int) -> Iterator[None]:
    """No file of this process may grow beyond what this one has and some bytes more."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + more_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("chunk_bytes", [1, 400, 1 << 18])
def test_what_is_read_is_what_was_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk_bytes: int
) -> None:
    """To the bit and to the type, however it was cut into chunks."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", chunk_bytes)
    ticks = records(50)
    assert write(tmp_path / "run", ticks).trouble is None
    back = read_spool(tmp_path / "run")
    assert back.scenario == SCENARIO
    assert back.ticks == ticks
    assert back.outcome == OUTCOME
    assert {type(field) for tick in back.ticks for field in tick[1:]} == {tuple}
    assert back.outcome is not None
    assert {type(joint) for joint in back.outcome.undriven} == {UndrivenJoint}


def test_a_fall_with_numbers_that_are_none_can_be_read_back(tmp_path: Path) -> None:
    """A body whose state overflowed is a run that has to be looked at."""
    fell = Outcome(3, (float("nan"), float("inf"), 0.0), (0.0, 0.0, 0.0), FELL, 0.0)
    write(tmp_path / "run", [], fell)
    assert repr(read_spool(tmp_path / "run").outcome) == repr(fell)


def chunk_ends(content: bytes) -> list[int]:
    """Where chunks end: magic, length and CRC-32 take twelve bytes before each."""
    ends = [0]
    while ends[-1] < len(content):
        start = ends[-1]
        length = int.from_bytes(content[start + 4 : start + 8], "little")
        ends.append(start + 12 + length)
    assert ends[-1] == len(content)
    return ends[1:]


def test_a_cut_at_any_byte_loses_the_last_chunk_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every offset of a spool of some chunks: all complete chunks are read, and nothing else."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    ticks = records(12)
    whole, cut = tmp_path / "run", tmp_path / "cut"
    write(whole, ticks)
    content = whole.read_bytes()
    ends = chunk_ends(content)
    assert len(ends) >= 4
    complete_ticks = []
    for end in ends:
        cut.write_bytes(content[:end])
        complete_ticks.append(len(read_spool(cut).ticks))
    assert complete_ticks == sorted(complete_ticks)
    assert complete_ticks[-1] == len(ticks)
    for size in range(len(content)):
        cut.write_bytes(content[:size])
        chunks = sum(end <= size for end in ends)
        if chunks == 0:
            with pytest.raises(ValueError, match="no complete chunk"):
                read_spool(cut)
            continue
        back = read_spool(cut)
        assert back.scenario == SCENARIO
        assert back.ticks == ticks[: complete_ticks[chunks - 1]]
        assert back.outcome is None


def test_a_flipped_bit_loses_its_chunk_and_what_follows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A length that cannot be trusted says nothing of where the next chunk begins."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    ticks = records(8)
    path = tmp_path / "run"
    write(path, ticks)
    content = path.read_bytes()
    ends = chunk_ends(content)
    for offset in range(ends[0], len(content)):
        flipped = bytearray(content)
        flipped[offset] ^= 1 << (offset % 8)
        path.write_bytes(flipped)
        back = read_spool(path)
        assert back.outcome is None
        assert back.ticks == ticks[: len(back.ticks)]
        assert len(back.ticks) < len(ticks) or offset >= ends[-2]


def test_what_follows_the_last_chunk_is_not_taken_for_one(tmp_path: Path) -> None:
    """A file system may leave a tail of zeros after a crash."""
    ticks = records(5)
    path = tmp_path / "run"
    write(path, ticks)
    path.write_bytes(path.read_bytes() + bytes(4096))
    assert (read_spool(path).ticks, read_spool(path).outcome) == (ticks, OUTCOME)


def test_a_run_that_was_killed_leaves_its_complete_chunks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What fills a chunk can soon be read while the writer is still at it, so also after a kill."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    monkeypatch.setattr(chunks, "WRITE_EVERY_S", 1e6)
    path = tmp_path / "run"
    ticks = records(20)
    writer = SpoolWriter(path, SCENARIO)

    for tick in ticks:
        writer.append(tick, None)
    # A tick is over 100 bytes, so no chunk here keeps more than four of them waiting.
    eventually(lambda: path.stat().st_size and len(read_spool(path).ticks) >= len(ticks) - 4)
    assert not read_spool(path).complete
    writer.close(OUTCOME)
    assert read_spool(path).ticks == ticks
    assert read_spool(path).complete


def test_what_fills_no_chunk_is_written_all_the_same_before_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also while nothing happens, as when the plant waits for a frozen board."""
    monkeypatch.setattr(chunks, "WRITE_EVERY_S", 0.01)
    path = tmp_path / "run"
    with SpoolWriter(path, SCENARIO) as writer:
        for tick in records(3):
            writer.append(tick, None)
        eventually(lambda: path.stat().st_size and read_spool(path).ticks == records(3))
    assert read_spool(path).outcome is None, "left, but not closed: the run had no end"


def test_a_full_disk_is_told_once_and_never_raises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rule 3: the control loop goes on, and what had been written can be read."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    path, told, ticks = tmp_path / "run", list[str](), records(200)
    writer = SpoolWriter(path, SCENARIO, tell=told.append)
    for tick in ticks[:10]:
        writer.append(tick, None)
    eventually(lambda: path.stat().st_size)
    with a_small_disk(path, 2000):
        for tick in ticks[10:100]:
            writer.append(tick, None)
        eventually(lambda: writer.trouble)
    first = writer.trouble
    for tick in ticks[100:]:
        writer.append(tick, None)
    writer.close(OUTCOME)
    assert told == ["recording stopped at tick 98: File too large; the run goes on"]
    assert writer.trouble is first
    back = read_spool(path)
    assert len(back.ticks) > 0
    assert back.ticks == ticks[: len(back.ticks)]
    assert not back.complete, "there is space again, but what follows a hole is not written"


def test_a_run_shorter_than_a_chunk_meets_the_full_disk_when_it_closes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chunks, "WRITE_EVERY_S", 1e6)
    path, told = tmp_path / "run", list[str]()
    writer = SpoolWriter(path, SCENARIO, tell=told.append)
    for tick in records(3):
        writer.append(tick, None)
    assert writer.trouble is None
    with a_small_disk(path, 10):
        writer.close(OUTCOME)
    assert told == ["recording is incomplete: File too large"]


class SlowDisk:
    """Stands in for `os.fsync`, and takes its time."""

    def __init__(self) -> None:
        self.reached = threading.Event()
        self.done = threading.Event()

    def __call__(self, _file: int) -> None:
        self.reached.set()
        assert self.done.wait(30.0)


@pytest.fixture
def slow_disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[SlowDisk]:
    disk = SlowDisk()
    monkeypatch.setattr(os, "fsync", disk)
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    yield disk
    disk.done.set()


def test_a_slow_disk_keeps_nobody_waiting_and_loses_nothing(
    tmp_path: Path, slow_disk: SlowDisk
) -> None:
    path, ticks = tmp_path / "run", records(300)
    writer = SpoolWriter(path, SCENARIO)
    for tick in ticks[:5]:
        writer.append(tick, None)
    assert slow_disk.reached.wait(30.0)
    for tick in ticks[5:]:
        writer.append(tick, None)  # Would wait for ever if it waited for the disk.
    assert len(read_spool(path).ticks) <= 5
    slow_disk.done.set()
    writer.close(OUTCOME)
    assert read_spool(path).ticks == ticks
    assert read_spool(path).complete


def test_a_disk_that_is_far_too_slow_ends_the_recording(
    tmp_path: Path, slow_disk: SlowDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits for it is bounded, and so is the time that the end of a run waits."""
    monkeypatch.setattr(chunks, "BACKLOG_BYTES_MAX", 5000)
    monkeypatch.setattr(chunks, "CLOSE_WITHIN_S", 0.01)
    told: list[str] = []
    writer = SpoolWriter(tmp_path / "run", SCENARIO, tell=told.append)
    writer.append(records(5)[0], None)
    for tick in records(300):
        writer.append(tick, None)
    writer.close(OUTCOME)
    slow_disk.done.set()
    assert writer.trouble is not None
    assert writer.trouble.errno == errno.EAGAIN
    assert len(told) == 1
    assert told[0].startswith("recording stopped at tick ")
    assert told[0].endswith(": the disk is too slow; the run goes on")


def test_a_disk_that_is_slow_at_the_end_is_not_waited_for_for_ever(
    tmp_path: Path, slow_disk: SlowDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chunks, "CLOSE_WITHIN_S", 0.01)
    told: list[str] = []
    writer = SpoolWriter(tmp_path / "run", SCENARIO, tell=told.append)
    writer.close(OUTCOME)
    assert told == ["recording is incomplete: the disk is too slow"]
    assert slow_disk.reached.wait(30.0)


def test_wall_times_timings_and_facts_are_read_back(tmp_path: Path) -> None:
    """To each tick its wall times; boards' frames as they came; later facts over earlier ones."""
    ticks = records(4)
    walls = [
        TickWallTimes(10, (20, 0, 30), 40),
        None,
        TickWallTimes(2**62, (0, 0, 0), 2**62 + 1),
        None,
    ]
    entry = TickTiming(0, 100, 120, -1, 5)
    frame = Timing(2**31, 1, -2, 2**60, 2**32 - 1, 10**7, 33_000, (entry, entry))
    facts = {"mode": "twin", "host": {"cores": 2, "cpu": None}}
    with SpoolWriter(tmp_path / "run", SCENARIO, facts) as writer:
        for tick, wall in zip(ticks, walls, strict=True):
            writer.append(tick, wall)
            writer.keep_report(tick.tick % 3, encode(frame._replace(tick=tick.tick)))
        writer.note({"mode": "processes"})
        writer.close(OUTCOME)
    back = read_spool(tmp_path / "run")
    assert back.walls == walls
    assert back.timings == [(tick.tick % 3, frame._replace(tick=tick.tick)) for tick in ticks]
    assert back.facts.pop("cpu_s") > 0.0
    assert back.facts.pop("memory_kb") > 1000
    assert back.facts == {"mode": "processes", "host": {"cores": 2, "cpu": None}}


def test_a_recording_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "run"
    write(path, records(3))
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        SpoolWriter(path, SCENARIO)
    assert path.read_bytes() == before
