"""`run.mcap` of a run in realtime: the same commands as in lockstep, and nothing lost."""

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest

from deploy.outcome.realtime_summary import realtime_summary
from deploy.recording.epochs import epochs
from deploy.recording.mcap.contents import NoRecordingError
from deploy.recording.mcap.file import read_mcap, write_mcap
from deploy.recording.reading import read_recording
from deploy.recording.realtime_replay import replay
from deploy.recording.realtime_times import realtime_times, turns
from deploy.recording.trajectory import recorded_trajectory
from plant_server.spool import spool as spools
from plant_server.spool.spool import PLANT, Spool, SpoolWriter, read_spool
from protocol.process.exit_codes import ExitCode
from protocol.wire.frames import KINDS, VERSION, seal
from protocol.wire.trace import Trace
from protocol.wire.trace_differences import decode_told
from tests.deploy.commands.test_recordings import drop_chunks, tampered, typed
from tests.deploy.recording.mcap.test_file import assert_same, contents, written
from tests.deploy.spools import by_the_wall

pytestmark = pytest.mark.slow


def spooled(of: Spool, folder: Path) -> Path:
    """A spool as the plant would write it: traces come in between ticks."""
    path = folder / "run.spool"
    told = iter(of.realtime)
    with SpoolWriter(path, of.scenario, of.facts) as writer:
        for i, (record, walls) in enumerate(zip(of.ticks, of.walls, strict=True)):
            writer.append(record, walls)
            for _ in range(
                len(of.realtime) * i // len(of.ticks), len(of.realtime) * (i + 1) // len(of.ticks)
            ):
                writer.keep_realtime(*next(told))
        writer.close(of.outcome)
    return path


def wide(value: Any) -> bytes:
    """Integers in arrays, each in nine bytes."""
    if isinstance(value, int):
        return b"\xd3" + value.to_bytes(8, "big", signed=True)
    head: bytes = msgpack.Packer().pack_array_header(len(value))
    return head + b"".join(map(wide, value))


def foreign(of: Spool) -> Spool:
    """The same, told by boards that write every integer in nine bytes, a turn a frame."""
    told = []
    for board, payload in of.realtime:
        trace = None if board == PLANT else decode_told(payload)
        if not isinstance(trace, Trace):
            told.append((board, payload))
            continue
        for one in trace.lived:
            turn = [*one[:-1], [list(taken) for taken in one.taken]]
            frame = [VERSION, KINDS[Trace], [trace.run_id, trace.incarnation, [turn]]]
            told.append((board, seal(wide(frame))))
    return of._replace(realtime=tuple(told))


@pytest.mark.parametrize("of", [by_the_wall(), foreign(by_the_wall())], ids=["ours", "foreign"])
def test_what_is_read_back_is_the_spool_byte_for_byte(tmp_path: Path, of: Spool) -> None:
    back = read_mcap(written(of, tmp_path))
    assert_same(back, of)
    assert replay(back) == replay(by_the_wall())
    assert replay(back).differences == ()


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.99])
def test_what_is_whole_of_a_cut_spool_is_recovered_as_it_is(
    tmp_path: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spools, "CHUNK_BYTES", 4000)
    path = spooled(by_the_wall(), tmp_path)
    drop_chunks(path, share)
    of = read_spool(path)
    assert 0 < len(of.realtime) < len(by_the_wall().realtime)
    typed("recover", tmp_path)
    back = read_mcap(tmp_path / "run.mcap")
    assert_same(back, of)
    assert not back.complete
    done = typed("replay", tmp_path)
    assert done.exit_code == ExitCode.OK
    ticks = of.ticks[-1].tick + 1
    assert f"identical: {ticks} ticks; the recording is incomplete, " in done.stdout


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_of_a_cut_file_there_are_the_turns_of_the_ticks_that_are_there(
    tmp_path: Path, share: float
) -> None:
    path = written(by_the_wall(), tmp_path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(NoRecordingError, match="damaged or cut off"):
        read_mcap(path)
    typed("recover", path)
    back = read_mcap(tmp_path / "run.recovered.mcap")
    assert back.ticks == by_the_wall().ticks[: len(back.ticks)]
    assert back.realtime == by_the_wall().realtime[: len(back.realtime)]
    assert all(
        turn.seen_tick <= back.ticks[-1].tick
        for own in turns(back)
        for life in own
        for turn in life
    )
    assert replay(back).differences == ()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run."""
    folder = tmp_path_factory.mktemp("run")
    of = by_the_wall()
    write_mcap(of, recorded_trajectory(of), folder / "run.mcap", lambda _tick: None)
    return folder


def test_every_turn_is_told_with_its_times(whole: Path) -> None:
    found = contents(whole / "run.mcap")
    for board, joint in enumerate(("ankle", "knee", "hip")):
        lived = [turn for life in turns(by_the_wall())[board] for turn in life]
        told = found[f"/{joint}/turn"]
        assert [body["slot"] for *_, body in told] == [turn.slot for turn in lived]
        assert [body["tick"] for *_, body in told] == [2 * turn.slot for turn in lived]
        for (log_ns, publish_ns, body), turn in zip(told, lived, strict=True):
            assert log_ns == 10**12 + body["tick"] * 10**6
            assert publish_ns == (turn.woke_us + turn.busy_us) * 1000
    assert {body["sender"] for *_, body in found["/knee/last_word"]} == {2}
    (account,) = found["/plant/pace"]
    assert account[2] == dict(by_the_wall().realtime)[PLANT]


def test_torques_are_those_in_force_and_observations_those_that_were_used(whole: Path) -> None:
    found = contents(whole / "run.mcap")
    angles = {body["tick"]: body["angles_rad"] for *_, body in found["/plant/tick"]}
    for board, joint in enumerate(("ankle", "knee", "hip")):
        there = [record.tick for record in by_the_wall().ticks if record.answers[board]]
        assert [log_ns // 10**6 - 10**6 for log_ns, *_ in found[f"/{joint}/torque"]] == there
        told = {body["tick"]: body["joint_rad"] for *_, body in found[f"/{joint}/observation"]}
        assert told == {tick: angles[tick][board] for tick in told}
        lived = [turn for life in turns(by_the_wall())[board] for turn in life]
        assert {turn.seen_tick for turn in lived} <= set(told)
    assert len(found["/epoch"]) == 4
    assert not any("/link/" in topic for topic in found)


@pytest.mark.parametrize(
    ("topic", "tick", "change", "said"),
    [
        ("/knee/observation", 80, {"joint_rad": 0.0}, "tick 80: joint_rad on /knee/observation: "),
        ("/epoch", 97, {"y": [2, 0, 0]}, "tick 97: y on /epoch: "),
        ("/hip/turn", 80, {"tick": 81}, "tick 80: tick on /hip/turn: "),
    ],
)
def test_a_tampered_value_is_found(
    tmp_path: Path, whole: Path, topic: str, tick: int, change: dict[str, object], said: str
) -> None:
    path = tmp_path / "run.mcap"
    tampered(whole / "run.mcap", path, topic, tick, lambda body: {**body, **change})
    done = typed("replay", path)
    assert done.exit_code == ExitCode.FAILED
    assert done.stdout.startswith(said)
    assert json.loads(typed("replay", path, "--json").stdout)["differences"]


def test_a_file_is_replayed_like_its_spool(tmp_path: Path, whole: Path) -> None:
    assert typed("replay", whole).output == typed("replay", spooled(by_the_wall(), tmp_path)).output


def test_a_file_says_of_turns_and_elections_what_its_spool_does(whole: Path) -> None:
    found = read_recording(whole)
    times, run = realtime_times(by_the_wall()), recorded_trajectory(by_the_wall())
    assert times is not None
    assert found.realtime is not None
    assert realtime_summary(found.realtime, run.joints) == realtime_summary(times, run.joints)
    expected = epochs(run)
    assert expected is not None
    for field in fields(expected):
        now, then = getattr(found.epochs, field.name), getattr(expected, field.name)
        assert np.array_equal(now, then, equal_nan=now.dtype.kind == "f")
    assert sum(board.periods for board in found.realtime.boards) > 500
