"""The spool gives back what was appended, up to the chunk in which it was cut off."""

import random
from itertools import accumulate
from math import pi
from pathlib import Path
from typing import Any

import pytest

from plant_server import spool
from plant_server.record import COMPLETE, FELL, Outcome, TickRecord, Undriven
from plant_server.spool import SpoolWriter, read_spool

SCENARIO: dict[str, Any] = {"name": "paper", "run": {"tick_s": 0.001, "seed": 2**62}, "board": []}
OUTCOME = Outcome(
    12,
    (0.1, -0.2, pi),
    (1e-300, 0.0, -5.5),
    COMPLETE,
    0.25,
    (Undriven("knee", -3, "braked", has_board=False), Undriven("hip", 7, "limp", has_board=True)),
)


def records(count: int, *, seed: int = 1) -> list[TickRecord]:
    """Ticks from -2 on: numbers of every size, answers of any bytes, all sorts of events."""
    rng = random.Random(seed)

    def numbers() -> tuple[float, ...]:
        return tuple(rng.uniform(-1.0, 1.0) * 10.0 ** rng.randint(-300, 300) for _ in range(3))

    def answers() -> tuple[bytes, ...]:
        return tuple(rng.randbytes(rng.randint(0, 30)) for _ in range(3))

    def events(tick: int) -> tuple[list[Any], ...]:
        if tick % 3:
            return ()
        return ["push", 2, 40.0, tick], ["sides", [[0], [1, 2]]], ["gone", 1, "died"]

    return [
        TickRecord(tick, numbers(), numbers(), numbers(), answers(), events(tick))
        for tick in range(-2, count - 2)
    ]


def write(path: Path, ticks: list[TickRecord], outcome: Outcome = OUTCOME) -> SpoolWriter:
    writer = SpoolWriter(path, SCENARIO)
    for tick in ticks:
        writer.append(tick)
    writer.close(outcome)
    return writer


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
    assert {type(joint) for joint in back.outcome.undriven} == {Undriven}


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
    assert complete_ticks[0] > 0
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
    """What has been flushed can be read while the writer is still at it, so also after a kill."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    path = tmp_path / "run"
    ticks = records(20)
    writer = SpoolWriter(path, SCENARIO)
    kept = []
    for tick in ticks:
        writer.append(tick)
        kept.append(len(read_spool(path).ticks) if path.stat().st_size else 0)
    assert read_spool(path).outcome is None
    # A tick is over 100 bytes, so no chunk here keeps more than four of them waiting.
    assert all(
        written - read <= 4 for written, read in zip(accumulate([1] * 20), kept, strict=True)
    )
    writer.close(OUTCOME)
    assert read_spool(path).ticks == ticks


def on_a_full_disk(path: Path) -> SpoolWriter:
    """A writer whose disk fills up as soon as it is open."""
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    writer = SpoolWriter(path, SCENARIO)
    writer._file.close()
    writer._file = full.open("wb")
    return writer


def test_a_full_disk_is_told_once_and_never_raises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rule 3: the control loop goes on, and the first trouble is the one that is kept."""
    monkeypatch.setattr(spool, "CHUNK_BYTES", 400)
    writer = on_a_full_disk(tmp_path / "run")
    told = []
    for tick in records(50):
        writer.append(tick)
        if writer.trouble is not None:
            told.append(writer.trouble)
    assert told
    writer.close(OUTCOME)
    assert {id(trouble) for trouble in told} == {id(writer.trouble)}
    assert "No space left" in str(writer.trouble)


def test_a_run_shorter_than_a_chunk_meets_the_full_disk_when_it_closes(tmp_path: Path) -> None:
    writer = on_a_full_disk(tmp_path / "run")
    for tick in records(3):
        writer.append(tick)
    assert writer.trouble is None
    writer.close(OUTCOME)
    assert writer.trouble is not None


def test_a_recording_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "run"
    write(path, records(3))
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        SpoolWriter(path, SCENARIO)
    assert path.read_bytes() == before
