"""The wire specification's test vectors are what the codec reads and writes."""

import json
import re
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest

from module_agent.firmware import link_model
from protocol.robot.chance import draw
from protocol.robot.events import (
    IN_TICKS,
    PERFECT,
    LinkChange,
    LinkOrder,
    ReferenceOrder,
    check_event,
    decode_board_command,
)
from protocol.robot.sensors import Readings
from protocol.robot.states import COUNTERS, State
from protocol.wire import enrolment, frames, keys
from protocol.wire.enrolment import EnrolmentReply, EnrolmentRequest
from protocol.wire.frames import (
    KINDS,
    AnyFrame,
    End,
    Fault,
    LinkFrame,
    LinkUse,
    Neighbour,
    Observation,
    StallReport,
    TorqueFrame,
)
from protocol.wire.timing import TickTiming, Timing
from protocol.wire.trace import LastWord, Trace

README = Path(frames.__file__).parents[1].joinpath("README.md").read_text(encoding="utf-8")
MESSAGES: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        Observation,
        LinkFrame,
        TorqueFrame,
        End,
        StallReport,
        Timing,
        Fault,
        Trace,
        LastWord,
        EnrolmentRequest,
        EnrolmentReply,
    )
}


def vectors(name: str = "") -> list[dict[str, Any]]:
    blocks = re.findall(rf"^```json{name}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)
    assert len(blocks) == 1, "one block of test vectors"
    found: list[dict[str, Any]] = json.loads(blocks[0])
    return found


def message(vector: dict[str, Any]) -> Any:
    values = dict(vector["values"])
    for field in ("scenario_digest", "command"):
        if field in values:
            values[field] = bytes.fromhex(values[field])
    if "readings" in values:
        values["readings"] = Readings(*values["readings"])
    if "neighbours" in values:
        values["neighbours"] = tuple(Neighbour(*entry) for entry in values["neighbours"])
    if "links" in values:
        values["links"] = tuple(LinkUse(*entry) for entry in values["links"])
    if "ticks" in values:
        values["ticks"] = tuple(TickTiming(*entry) for entry in values["ticks"])
    return MESSAGES[vector["kind"]](**values)


def encode(whole: Any) -> bytes:
    if isinstance(whole, EnrolmentRequest | EnrolmentReply):
        return enrolment.encode_enrolment(whole)
    return frames.encode(whole)


def decode(kind: str, payload: bytes) -> Any:
    if kind == "EnrolmentRequest":
        return enrolment.decode_request(payload)
    if kind == "EnrolmentReply":
        return enrolment.decode_reply(payload)
    expected: type[AnyFrame] = MESSAGES[kind]
    return frames.decode(expected, payload)


def types(whole: Any) -> list[type]:
    """Types of all numbers: 1 == 1.0 in Python, but not on the wire."""
    flat = [y for x in whole for y in (x if isinstance(x, tuple) else (x,))]
    return [type(x) for part in flat for x in (part if isinstance(part, tuple) else (part,))]


@pytest.mark.parametrize("vector", vectors(), ids=lambda vector: vector["about"])
def test_a_vector_holds_in_both_directions(vector: dict[str, Any]) -> None:
    whole = message(vector)
    assert encode(whole).hex() == vector["frame"]
    decoded = decode(vector["kind"], bytes.fromhex(vector["frame"]))
    assert decoded == whole
    assert types(decoded) == types(whole)


def test_every_kind_has_a_vector() -> None:
    assert {vector["kind"] for vector in vectors() + vectors(" traces")} == set(MESSAGES)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_its_section_with_its_table(kind: type) -> None:
    """That the table is of this kind as it is now, `deploy.generated` sees to."""
    _, _, section = README.partition(f"### {kind.__name__} (kind {KINDS[kind]})")
    section, _, _ = section.partition("\n### ")
    name = re.sub("(?<=[a-z])(?=[A-Z])", "-", kind.__name__).lower()
    assert f"<!-- generated: wire-{name} -->" in section


def test_the_specification_names_our_numbers() -> None:
    assert crc32(b"123456789") == 0xCBF43926
    assert "0xCBF43926" in README
    assert frames.NO_TICK == -(2**31)
    assert (frames.NO_EPOCH, frames.CRC_BYTES, frames.FRAME_BYTES_MAX) == (-1, 4, 256)
    for state in State:
        assert f"{state.value} {state.name.lower()}" in README


def test_the_specification_names_every_reason_and_verdict() -> None:
    for reason in frames.Reason:
        assert re.search(rf"^\| `{reason}` \|", README, re.MULTILINE), reason
    for verdict in enrolment.EnrolmentVerdict:
        name = verdict.name.lower().replace("_", " ")
        assert re.search(rf"^\| {verdict.value} \| {name} \|", README, re.MULTILINE), verdict


@pytest.mark.parametrize("vector", vectors(" link-draws"), ids=str)
def test_a_draw_of_the_link_model_is_as_specified(vector: dict[str, Any]) -> None:
    """S14: the hash, and how it becomes a number from 0 to 1."""
    value = draw(*(vector[name] for name in ("seed", "sender", "receiver", "tick", "purpose")))
    assert f"{value:016x}" == vector["value"]
    assert (value >> 11) * 2.0**-53 == vector["uniform"]


def test_the_specification_numbers_the_purposes_of_draws_as_we_do() -> None:
    _, _, table = README.partition("| purpose | number |")
    table, _, _ = table.partition("\n\n")
    told = {name: int(number) for name, number in re.findall(r"\| ([A-Z_]+) \| (\d)", table)}
    assert sorted(told.values()) == list(range(9))
    assert told == {name: getattr(link_model, name) for name in told}


def test_the_specification_lists_the_parameters_of_a_link_in_their_order() -> None:
    rows = re.findall(r"^\| (\d) \| `(\w+)` \| (\d) \| 0 (?:…|or) (\d+)", README, re.MULTILINE)
    assert [name for _, name, _, _ in rows] == list(PERFECT._fields)
    for place, name, perfect, most in rows:
        assert float(perfect) == PERFECT[int(place)]
        check_event(LinkChange((), {name: int(most)}), ["ankle", "knee"])
        assert int(most) == (31 if name in IN_TICKS else 1)


def test_the_specification_lists_the_counters_in_their_order() -> None:
    _, _, table = README.partition("| counter | counts |")
    table, _, _ = table.partition("\n### ")
    assert tuple(re.findall(r"`([a-z_]+)`", table)) == COUNTERS


def test_commands_in_vectors_are_commands() -> None:
    told = [bytes.fromhex(vector["values"].get("command", "")) for vector in vectors()]
    decoded = [decode_board_command(payload) for payload in told if payload]
    assert {type(command) for command in decoded} == {LinkOrder, ReferenceOrder}


def test_every_key_is_in_the_table_of_the_specification() -> None:
    for key in (
        keys.ENROL,
        keys.observation("{rig}", "{joint}"),
        keys.torque("{rig}", "{joint}"),
        keys.link("{rig}", "{joint}", "{neighbour}"),
        keys.stalled("{rig}", "{joint}"),
        keys.report("{rig}", "{joint}", Timing),
        keys.fault("{rig}", "{joint}"),
        keys.control("{rig}"),
        keys.end("{rig}"),
        keys.plant_alive("{rig}"),
    ):
        assert f"| `{key}` |" in README, key


def test_receipts_in_vectors_are_possible() -> None:
    for vector in vectors():
        for mask, _crc, unheard in vector["values"].get("links", []):
            assert 0 <= mask < 2**64
            assert 0 <= unheard <= 255
