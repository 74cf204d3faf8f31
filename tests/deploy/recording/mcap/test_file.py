"""`run.mcap` holds the whole recording, byte for byte, and says what it holds."""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from math import inf, nan
from pathlib import Path
from typing import Any

import msgpack
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from deploy.recording.logical_digest import logical_sha256
from deploy.recording.mcap.bodies import to_event
from deploy.recording.mcap.contents import METADATA, NoRecordingError
from deploy.recording.mcap.file import read_mcap, write_mcap
from deploy.recording.mcap.messages import channels
from deploy.recording.trajectory import recorded_trajectory
from plant_server.session.record import FELL, UndrivenJoint
from plant_server.spool.spool import Spool
from protocol.robot.events import EnergyLoss, MidwayDeparture
from protocol.robot.sensors import Readings
from protocol.wire.frames import VERSION, LinkFrame, Observation, TorqueFrame, decode, encode, seal
from tests.deploy.spools import SHORT, by_the_wall, opened_ns, spool, timed

pytestmark = pytest.mark.slow

Found = dict[str, list[tuple[int, int, dict[str, Any]]]]
"""By topic: log time, publish time and body of each message."""


def written(of: Spool, folder: Path) -> Path:
    path = folder / "run.mcap"
    write_mcap(of, recorded_trajectory(of), path, lambda _tick: None)
    return path


def assert_same(back: Spool, of: Spool) -> None:
    """To the bit and to the type; only names in a dictionary have no order."""
    assert (back.scenario, back.facts) == (of.scenario, of.facts)
    for name, now, then in zip(Spool._fields[2:], back[2:], of[2:], strict=True):
        assert repr(now) == repr(then), name


def contents(path: Path) -> Found:
    """What the library's own reader finds in a file, checksums checked."""
    found: Found = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert channel.message_encoding == "json"
            body = json.loads(message.data, parse_constant=_refuse)
            found.setdefault(channel.topic, []).append(
                (message.log_time, message.publish_time, body)
            )
    return found


def _refuse(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


@pytest.mark.parametrize("name", SHORT)
@pytest.mark.parametrize("clothed", [timed, lambda of: of], ids=["processes", "twin"])
def test_what_is_read_back_is_the_spool_byte_for_byte(
    tmp_path: Path, name: str, clothed: Callable[[Spool], Spool]
) -> None:
    of = clothed(spool(name))
    back = read_mcap(written(of, tmp_path))
    assert_same(back, of)


def test_s20_the_file_of_a_scenario_differs_in_its_facts_alone(tmp_path: Path) -> None:
    first, second = tmp_path / "1", tmp_path / "2"
    for folder in (first, second):
        folder.mkdir()
    assert written(spool(), first).read_bytes() == written(spool(), second).read_bytes()


def odd(of: Spool) -> Spool:
    """The same body, fallen into numbers that are none; and a board that writes long integers."""
    ticks = list(of.ticks)
    last = ticks[-1]
    frame = decode(TorqueFrame, last.answers[0])._replace(torque_nm=nan, controlled_rad=-inf)
    fields = msgpack.unpackb(last.answers[2][:-4])
    long = b"\xdc" + len(fields).to_bytes(2, "big") + b"".join(map(_long, fields))
    ticks[-1] = last._replace(
        angles_rad=(nan, inf, -0.0),
        rates_rad_s=(-inf, 1e308, 5e-324),
        answers=(encode(frame), b"", seal(long)),
        events=(EnergyLoss(1, nan), MidwayDeparture(1, "died")),
    )
    assert of.outcome is not None
    undriven = UndrivenJoint("knee", -3, "braked", has_board=False)
    outcome = of.outcome._replace(ending=FELL, angles_rad=(nan, nan, nan), undriven=(undriven,))
    return of._replace(ticks=ticks, outcome=outcome)


def _long(value: float) -> bytes:
    """An integer in nine bytes: right, and not how we would write it."""
    if type(value) is int and value >= 0:
        return b"\xcf" + value.to_bytes(8, "big")
    return bytes(msgpack.packb(value))


def test_what_is_no_number_or_written_by_another_hand_comes_back_too(tmp_path: Path) -> None:
    of = odd(spool())
    path = written(of, tmp_path)
    assert_same(read_mcap(path), of)
    body = contents(path)["/plant/tick"][-1][2]
    assert body["angles_rad"] == ["NaN", "Infinity", 0.0]
    assert "frame_hex" in contents(path)["/hip/torque"][-1][2]


def test_a_recording_that_was_cut_off_says_so(tmp_path: Path) -> None:
    of = timed(spool("storm"))
    cut = of._replace(
        ticks=of.ticks[:137], walls=of.walls[:137], outcome=None, complete=False, reports=[]
    )
    path = written(cut, tmp_path)
    assert read_mcap(path) == cut
    assert metadata(path)[METADATA]["complete"] == "false"


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


def test_the_metadata_say_what_it_is_without_reading_on(tmp_path: Path) -> None:
    of = timed(spool())
    found = metadata(written(of, tmp_path))
    about = found[METADATA]
    assert about.pop("logical_sha256") == logical_sha256(of)
    assert len(about.pop("digest")) == 64
    assert about.pop("wire") == str(VERSION)
    assert about == {"format": "2", "complete": "true", "scenario": "paper", "ticks": "300"}
    assert found["facts"]["mode"] == "processes"
    assert found["facts"]["clock"] == "7"


def problems(value: Any, schema: dict[str, Any], where: str) -> Iterator[str]:
    """What a JSON schema of ours finds wrong; words for numbers that are none are let through."""
    kinds = {"array": list, "boolean": bool, "integer": int, "number": float, "object": dict}
    allowed: tuple[type, ...] = (kinds.get(schema["type"], str),)
    if schema["type"] == "number":
        allowed = (float, int)
        if value in ("NaN", "Infinity", "-Infinity"):
            return
    if type(value) not in allowed:
        yield f"{where} is {value!r}, not {schema['type']}"
    elif schema["type"] == "array":
        for i, item in enumerate(value):
            yield from problems(item, schema["items"], f"{where}[{i}]")
    elif "properties" in schema:
        properties = schema["properties"]
        yield from (f"{where} lacks {name}" for name in schema["required"] if name not in value)
        for name, item in value.items():
            if name in properties:
                yield from problems(item, properties[name], f"{where}.{name}")
            else:
                yield f"{where} has {name}"


@pytest.mark.parametrize(
    "of", [timed(spool("storm")), odd(spool()), by_the_wall()], ids=["storm", "odd", "realtime"]
)
def test_every_message_is_what_its_schema_says(tmp_path: Path, of: Spool) -> None:
    path = written(of, tmp_path)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    schemas = {
        channel.topic: json.loads(summary.schemas[channel.schema_id].data)
        for channel in summary.channels.values()
    }
    assert set(schemas) == set(channels(["ankle", "knee", "hip"], in_realtime=of.in_realtime))
    wrong = [
        problem
        for topic, messages in contents(path).items()
        for *_, body in messages
        for problem in problems(body, schemas[topic], topic)
    ]
    assert wrong == []


def descriptions(schema: dict[str, Any], where: str) -> Iterator[tuple[str, str]]:
    for name, inner in schema["properties"].items():
        yield f"{where}.{name}", inner.get("description", "")
        if inner["type"] == "array" and inner["items"]["type"] == "object":
            yield from descriptions(inner["items"], f"{where}.{name}")


def test_every_field_is_described() -> None:
    found = [
        field
        for in_realtime in (False, True)
        for kind in channels(["knee", "hip"], in_realtime=in_realtime).values()
        for field in descriptions(kind.schema, kind.name)
    ]
    assert len(found) > 160
    assert [name for name, about in found if not about] == []


@cache
def storm() -> Spool:
    return timed(spool("storm"))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Found:
    return contents(written(storm(), tmp_path_factory.mktemp("storm")))


def test_every_tick_of_everybody_is_there_and_at_its_time(found: Found) -> None:
    """Log time is the body's; publish time is the wall's."""
    ticks = [record.tick for record in storm().ticks]
    times = [(log_ns, publish_ns) for log_ns, publish_ns, _ in found["/plant/tick"]]
    assert times == [(10**12 + t * 10**6, opened_ns(t) + 600_000) for t in ticks]
    for board, joint in enumerate(("ankle", "knee", "hip")):
        there = [record.tick for record in storm().ticks if record.answers[board]]
        for topic in (f"/{joint}/observation", f"/{joint}/torque"):
            assert [body["tick"] for *_, body in found[topic]] == there
        assert {log_ns - 10**12 - body["tick"] * 10**6 for log_ns, _, body in found[topic]} == {0}


def test_observations_and_link_frames_are_those_of_the_run(found: Found) -> None:
    """Link frames by the CRC-32 in the receipt; observations by what the plant's tick says."""
    for *_, body in found["/knee/link/hip"]:
        frame = {name: body[name] for name in LinkFrame._fields if name != "heard_tick"}
        payload = encode(LinkFrame(**frame, heard_tick=body["echo_tick"]))
        assert int.from_bytes(payload[-4:], "little") == body["sent_crc"]
    angles = {body["tick"]: body["angles_rad"] for *_, body in found["/plant/tick"]}
    for *_, body in found["/knee/observation"]:
        assert body["joint_rad"] == angles[body["tick"]][1]
        told = {*Observation._fields, *Readings._fields, "command_hex"}
        assert set(body) == told - {"command", "readings"}


def test_fates_are_told_in_words(found: Found) -> None:
    fates = Counter(body["fate"] for *_, body in found["/knee/link/hip"])
    assert set(fates) == {"heard", "late", "lost", "corrupt", "cut", "nobody", "pending"}
    for *_, body in found["/knee/link/hip"]:
        if body["fate"] == "heard":
            assert body["heard_tick"] == body["tick"] + 1
        elif body["fate"] == "late":
            assert body["heard_tick"] > body["tick"] + 1
        else:
            assert body["heard_tick"] == -(2**31)


def test_every_epoch_and_event_is_told(found: Found) -> None:
    assert [body["epoch"] for *_, body in found["/epoch"]] == list(range(5))
    first = found["/epoch"][0][2]
    assert (first["began_tick"], first["members"]) == (0, ["ankle", "knee", "hip"])
    assert max(first["w_rad"]) == first["w_rad"][2] > 0.5
    events = [event for record in storm().ticks for event in record.events]
    assert [to_event(body) for *_, body in found["/event"]] == events
    assert {"admitted", "link", "push", "unplug", "gone", "plug", "sides"} <= {
        body["what"] for *_, body in found["/event"]
    }


def test_ten_seconds_take_less_than_30_mb(tmp_path: Path) -> None:
    size = written(storm(), tmp_path).stat().st_size
    assert size < 30e6 / 10_000 * len(storm().ticks) / 2, "with room to spare"


def test_a_file_appears_when_it_is_whole_and_not_before(tmp_path: Path) -> None:
    def stop(tick: int) -> None:
        if tick == 100:
            raise KeyboardInterrupt

    of, path = spool(), tmp_path / "run.mcap"
    with pytest.raises(KeyboardInterrupt):
        write_mcap(of, recorded_trajectory(of), path, stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_is_refused_and_read_as_far_as_it_is_whole(
    tmp_path: Path, share: float
) -> None:
    of = timed(spool("storm"))
    path = written(of, tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(NoRecordingError, match="damaged or cut off"):
        read_mcap(path)
    try:
        back = read_mcap(path, whole=False)
    except NoRecordingError:
        assert share < 0.5
        return
    assert share >= 0.1
    assert not back.complete
    assert back.outcome in (None, of.outcome)
    assert back.ticks == of.ticks[: len(back.ticks)]
    assert len(back.ticks) > 0.8 * share * len(of.ticks) - 200


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_flipped_bit_is_found(tmp_path: Path, share: float) -> None:
    path = written(spool(), tmp_path)
    content = bytearray(path.read_bytes())
    content[int(share * len(content))] ^= 16
    path.write_bytes(content)
    with pytest.raises(NoRecordingError, match="damaged or cut off"):
        read_mcap(path)


def test_other_files_are_told_from_ours(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("other", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/x", "json", schema), 1, b"{}", 1)
        writer.finish()
    with pytest.raises(NoRecordingError, match="not of decmesh"):
        read_mcap(path)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_metadata(METADATA, {"format": "99"})
        writer.finish()
    with pytest.raises(NoRecordingError, match="format 99, and this decmesh reads format 2"):
        read_mcap(path)
