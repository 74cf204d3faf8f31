"""Frames: what is written is read back, and nothing else is ever taken for a frame."""

import struct
from math import inf, nan, nextafter
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.robot.sensors import Readings
from protocol.wire.enrolment import (
    EnrolmentReply,
    EnrolmentRequest,
    decode_reply,
    decode_request,
    encode_enrolment,
)
from protocol.wire.fields import Field
from protocol.wire.fields import fields as fields_of
from protocol.wire.frames import (
    FAULT_TEXT_BYTES_MAX,
    FRAME_BYTES_MAX,
    KINDS,
    TEXT_BYTES_MAX,
    VERSION,
    End,
    Fault,
    LinkFrame,
    LinkUse,
    Neighbour,
    Observation,
    ProtocolError,
    Reason,
    StallReport,
    TorqueFrame,
    decode,
    encode,
    receive,
    seal,
)
from protocol.wire.timing import TickTiming, Timing
from protocol.wire.trace import LastWord, TakenFrames, TickTrace, Trace

LAW = settings(max_examples=100, deadline=None, derandomize=True)
LONGEST_COMMAND = 93
"""Bytes of a board command that sets all parameters of a link."""
INTS = st.integers(-(2**63), 2**64 - 1)
FLOATS = st.floats()
JUNK = st.recursive(
    st.none() | st.booleans() | INTS | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=8,
)

LINK = LinkFrame(2**32 - 1, 1, 1, 0, 0, 1, 0.5, 2, -1, -0.1, 0.0, 40.0, 0.1, 0.6, 0.0, 0.0)
SAMPLES: list[Any] = [
    Observation(
        2**31, 1, 7, Readings(0.1, 0.2, 3.0, 0.0, 0.0, 490.5, 0.01), b"", (Neighbour(1, 6, 1),) * 2
    ),
    LINK,
    TorqueFrame(2**31, 1, 7, 1.5, 2, 1, 0.1, 0, 1, 0.5, 2, 3, 40, (LinkUse(1, 2**32 - 1, 0),) * 2),
    End(2**31, "complete"),
    StallReport(2**31, 1, 7, 2),
    Timing(2**31, 1, 7, 2**46, 2**32 - 1, 10**6, 33000, (TickTiming(0, 99, 130, -1, 12),) * 2),
    Fault(2**31, 1, 7, 2, 0, 1, "nan, which is no finite number"),
    Trace(2**31, 1, (TickTrace(7, 10**12, 80, 310, 700, 14, 0, 3, (TakenFrames(12, 1),) * 2),) * 2),
    LastWord(2**31, 1, 2, bytes(100)),
]
ENROLMENTS: list[Any] = [
    EnrolmentRequest(VERSION, "robot", "knee", 0, bytes(32), 2**63 - 1, 3, 0, 10.0, 0.5, 0.25, 0.2),
    EnrolmentReply(VERSION, 3, "no such joint", 2**31, 0),
]


def _strategy(message: Any) -> st.SearchStrategy[Any]:
    """Any message of a kind, with every value that its fields allow."""
    return st.builds(message, *map(_values, fields_of(message)))


def _values(of: Field) -> st.SearchStrategy[Any]:
    if of.repeats:
        return st.lists(_strategy(of.type), max_size=2).map(tuple)
    if of.type is int:
        least, most = -(2**63) if of.ge is None else of.ge, 2**64 - 1 if of.le is None else of.le
        return st.integers(int(least), int(most))
    if of.type is float:
        return st.floats(of.ge, of.le)
    plain = {str: st.text(max_size=40), bytes: st.binary(max_size=LONGEST_COMMAND)}
    return plain[of.type] if of.type in plain else _strategy(of.type)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_read_back(kind: Any) -> None:
    """To the bit: `repr` tells NaN, -0.0 and int from float apart."""

    @LAW
    @given(_strategy(kind))
    def law(frame: Any) -> None:
        decoded = decode(kind, encode(frame))
        assert repr(decoded) == repr(frame)
        assert type(decoded) is kind

    law()


def _decode_any(payload: bytes, like: Any) -> Any:
    if isinstance(like, EnrolmentRequest):
        return decode_request(payload)
    if isinstance(like, EnrolmentReply):
        return decode_reply(payload)
    return decode(type(like), payload)


def _encode_any(message: Any) -> bytes:
    if isinstance(message, EnrolmentRequest | EnrolmentReply):
        return encode_enrolment(message)
    return encode(message)


def _refusal(payload: bytes, like: Any = LINK) -> Reason:
    with pytest.raises(ProtocolError) as refused:
        _decode_any(payload, like)
    return refused.value.reason


@pytest.mark.parametrize("frame", SAMPLES + ENROLMENTS, ids=lambda frame: type(frame).__name__)
def test_every_single_bit_flip_is_noticed(frame: Any) -> None:
    """S1: all bits of all kinds, the CRC's own included."""
    payload = _encode_any(frame)
    for bit in range(8 * len(payload)):
        flipped = bytearray(payload)
        flipped[bit // 8] ^= 1 << bit % 8
        assert _refusal(bytes(flipped), frame) is Reason.CORRUPT, f"bit {bit}"


@pytest.mark.parametrize("frame", SAMPLES + ENROLMENTS, ids=lambda frame: type(frame).__name__)
def test_every_truncation_is_noticed(frame: Any) -> None:
    payload = _encode_any(frame)
    for length in range(len(payload)):
        reason = Reason.SIZE if length < 5 else Reason.CORRUPT
        assert _refusal(payload[:length], frame) is reason


def test_size_is_checked_first() -> None:
    assert _refusal(b"") is Reason.SIZE
    assert _refusal(seal(bytes(FRAME_BYTES_MAX - 3))) is Reason.SIZE
    assert _refusal(bytes(FRAME_BYTES_MAX)) is Reason.CORRUPT
    assert _refusal(bytes(10**6)) is Reason.SIZE


@LAW
@given(st.binary(max_size=300), st.sampled_from(SAMPLES + ENROLMENTS))
def test_random_bytes_are_refused_and_nothing_else_happens(payload: bytes, like: Any) -> None:
    assert _refusal(payload, like) in (Reason.SIZE, Reason.CORRUPT)


@LAW
@given(st.binary(min_size=1, max_size=252), st.sampled_from(SAMPLES + ENROLMENTS))
def test_random_bytes_with_a_right_crc_are_refused(body: bytes, like: Any) -> None:
    assert _refusal(seal(body), like) in (Reason.MALFORMED, Reason.VERSION)


@LAW
@given(st.lists(JUNK, max_size=20), st.sampled_from(SAMPLES + ENROLMENTS))
def test_well_formed_msgpack_that_is_no_frame_is_refused(fields: list[Any], like: Any) -> None:
    payload = seal(msgpack.packb([VERSION, *fields]))
    assert _refusal(payload, like) in (Reason.MALFORMED, Reason.SIZE)


@pytest.mark.parametrize(
    "body",
    [
        b"\x91" * 251 + b"\x01",  # as deep as fits
        b"\x81\x01" * 125 + b"\x01",
        b"\x01",  # no array
        b"\x80",
        b"\x90",  # no version
        b"\xdd\xff\xff\xff\xff",  # 4 billion elements announced
        b"\xc6\xff\xff\xff\xff",
        b"\xc1",  # never used by msgpack
        b"\x92\x02\xa2\xff\xfe",  # not UTF-8
        b"\x92\x02\xc7\x0c\xff" + b"\xff" * 12,  # a time stamp out of range
        b"\x92\x02\xd4\x05\x00",  # an extension
        b"\x92\x02\x81\x90\x01",  # a list for a key
    ],
    ids=bytes.hex,
)
@pytest.mark.parametrize("like", SAMPLES + ENROLMENTS, ids=lambda frame: type(frame).__name__)
def test_hostile_msgpack_is_malformed(body: bytes, like: Any) -> None:
    refusals = (Reason.MALFORMED, Reason.VERSION)  # A nested array is no version.
    assert _refusal(seal(body), like) in refusals


def _array(frame: Any) -> list[Any]:
    """Version, kind, and the array of fields."""
    elements: list[Any] = msgpack.unpackb(encode(frame)[:-4])
    return elements


def _refused_fields(frame: Any, fields: list[Any]) -> Reason:
    version, kind, _ = _array(frame)
    return _refusal(seal(msgpack.packb([version, kind, fields])), frame)


@pytest.mark.parametrize("frame", SAMPLES, ids=lambda frame: type(frame).__name__)
def test_every_field_has_one_type(frame: Any) -> None:
    """A bool is no int, a float is none, and nothing stands in for a number."""
    fields = _array(frame)[2]
    others: list[Any] = [True, None, "1", b"1", [1], {}, 1.0]
    for i in range(len(fields)):
        for wrong in others:
            if type(wrong) is not type(fields[i]):
                told = [*fields[:i], wrong, *fields[i + 1 :]]
                assert _refused_fields(frame, told) is Reason.MALFORMED, f"field {i}: {wrong!r}"


def test_an_int_stands_for_the_float_that_it_is() -> None:
    version, kind, fields = _array(LINK._replace(urgency=2.0))
    assert fields[6] == 2.0
    fields[6] = 2
    read = decode(LinkFrame, seal(msgpack.packb([version, kind, fields])))
    assert repr(read.urgency) == "2.0"


@pytest.mark.parametrize("frame", SAMPLES, ids=lambda frame: type(frame).__name__)
def test_every_entry_has_its_number_of_ints(frame: Any) -> None:
    fields = _array(frame)[2]
    if isinstance(fields[-1], list):
        entry = fields[-1][0]
        for wrong in ([], entry[:-1], [*entry, 1], [*entry[:-1], 1.0], [*entry[:-1], [1]], None):
            told = [*fields[:-1], [entry, wrong]]
            assert _refused_fields(frame, told) is Reason.MALFORMED, f"entry {wrong!r}"


@pytest.mark.parametrize("frame", SAMPLES, ids=lambda frame: type(frame).__name__)
def test_every_frame_has_its_number_of_fields(frame: Any) -> None:
    version, kind, fields = _array(frame)
    for length in range(len(fields)):
        assert _refused_fields(frame, fields[:length]) is Reason.MALFORMED
    assert _refused_fields(frame, [*fields, 1]) is Reason.MALFORMED
    for elements in ([version], [version, kind], [version, kind, fields, 1]):
        assert _refusal(seal(msgpack.packb(elements)), frame) is Reason.MALFORMED
    assert _refusal(seal(encode(frame)[:-4] + b"\x01"), frame) is Reason.MALFORMED


@pytest.mark.parametrize("frame", SAMPLES, ids=lambda frame: type(frame).__name__)
def test_one_kind_is_never_taken_for_another(frame: Any) -> None:
    for other in SAMPLES:
        if type(other) is not type(frame):
            assert _refusal(encode(frame), other) is Reason.MALFORMED


@pytest.mark.parametrize("version", [0, 1, 3, -1, 2**64 - 1, 1.5, "1", None, [1]])
def test_another_version_is_refused_before_its_fields_are_looked_at(version: Any) -> None:
    assert _refusal(seal(msgpack.packb([version, "what", "ever"]))) is Reason.VERSION


@pytest.mark.parametrize("element", [0, 1], ids=["version", "kind"])
@pytest.mark.parametrize("wrong", [True, "float"])
def test_version_and_kind_are_ints_too(element: int, wrong: Any) -> None:
    """Python takes True and 1.0 for 1; a board in C does not."""
    for frame in SAMPLES:
        fields = _array(frame)
        fields[element] = True if wrong is True else float(fields[element])
        refusal = _refusal(seal(msgpack.packb(fields)), frame)
        assert refusal is (Reason.VERSION if fields[0] is True else Reason.MALFORMED)


@pytest.mark.parametrize(
    "tick", [b"\x07", b"\xcc\x07", b"\xcd\x00\x07", b"\xd3" + b"\x00" * 7 + b"\x07"]
)
def test_any_int_encoding_is_accepted(tick: bytes) -> None:
    frame = LINK._replace(tick=7)
    start = 3 + len(msgpack.packb([0] * 16)) - 16 + len(msgpack.packb(frame.run_id)) + 1
    body = encode(frame)[:-4]
    assert body[start : start + 1] == b"\x07"
    assert decode(LinkFrame, seal(body[:start] + tick + body[start + 1 :])) == frame


def test_a_float_is_sent_as_float_64_whatever_its_value() -> None:
    for value in (0.0, 1.0, 0.1, -0.0):
        assert b"\xcb" + struct.pack(">d", value) in encode(LINK._replace(urgency=value))


def _worst(message: Any) -> Any:
    """Every int as long as can be, and as many neighbours as a chain has."""
    text_bytes = FAULT_TEXT_BYTES_MAX if message is Fault else TEXT_BYTES_MAX
    plain: dict[type, Any] = {str: "x" * text_bytes, bytes: bytes(LONGEST_COMMAND)}
    values: list[Any] = []
    for of in fields_of(message):
        if of.repeats:
            values.append((_worst(of.type),) * 2)
        elif of.type is int:
            values.append(2**64 - 1 if of.le is None else int(of.le))
        elif of.type is float:
            values.append(1e-300)
        else:
            values.append(plain[of.type] if of.type in plain else _worst(of.type))
    return message(*values)


@pytest.mark.parametrize("kind", KINDS)
def test_the_worst_frame_of_every_kind_fits(kind: Any) -> None:
    frame = _worst(kind)
    payload = encode(frame)
    assert len(payload) <= FRAME_BYTES_MAX
    assert decode(kind, payload) == frame


def test_an_oversized_frame_of_ours_is_our_mistake() -> None:
    with pytest.raises(AssertionError, match="End of 316 bytes"):
        encode(End(2**31, "x" * 300))


@LAW
@given(st.lists(FLOATS, min_size=8, max_size=8), st.integers(1, 127), st.integers(2**31, 2**32 - 1))
def test_size_does_not_depend_on_values(
    numbers: list[float], incarnation: int, run_id: int
) -> None:
    """Nor on the run or on how often a board has booted: the network has one load."""
    urgency, *body = numbers
    frame = LinkFrame(run_id, incarnation, 9, 8, 0, 1, urgency, 2, 5, *body)
    assert len(encode(frame)) == len(encode(LINK))


def _beyond(of: Field) -> list[Any]:
    """Numbers next to those that a field may be."""
    if of.type is float:
        ends = [(of.ge, -inf), (of.le, inf)]
        return [nextafter(end, out) for end, out in ends if end is not None] + [nan, inf, -inf]
    return [end + out for end, out in ((of.ge, -1), (of.le, 1)) if end is not None]


def _bounded(message: type) -> list[tuple[int, Field]]:
    return [(i, of) for i, of in enumerate(fields_of(message)) if (of.ge, of.le) != (None, None)]


@pytest.mark.parametrize("frame", SAMPLES, ids=lambda frame: type(frame).__name__)
def test_a_number_out_of_range_is_the_last_reason(frame: Any) -> None:
    """Whoever has other reasons gets the frame to look for them."""
    kind: Any = type(frame)
    entries = fields_of(kind)[-1]
    wrong = [
        frame._replace(**{of.name: value})
        for _, of in _bounded(type(frame))
        for value in _beyond(of)
    ]
    if entries.repeats:
        entry = frame[-1][0]
        wrong += [
            frame._replace(**{entries.name: (entry, entry._replace(**{of.name: value}))})
            for _, of in _bounded(entries.type)
            for value in _beyond(of)
        ]
    for told in wrong:
        payload = encode(told)
        assert _refusal(payload, frame) is Reason.RANGE, told
        read, out_of_range = receive(type(frame), payload)
        assert out_of_range is not None
        assert out_of_range.reason is Reason.RANGE
        assert read[:3] == frame[:3]
    assert receive(type(frame), encode(frame)) == (frame, None)


def test_bounds_are_where_the_specification_needs_them() -> None:
    bounded = {kind.__name__: [of.name for _, of in _bounded(kind)] for kind in KINDS}
    assert bounded["LinkFrame"] == ["urgency", "candidate", *LinkFrame._fields[9:]]
    assert bounded["TorqueFrame"] == [
        "state", "enabled", "epoch", "round", "candidate", "counter", "counted",
    ]  # fmt: skip
    assert bounded["Fault"] == ["code", "part", "parts"]
    assert bounded["Observation"] == []


def test_a_command_of_any_bytes_passes_the_frame() -> None:
    """What it means is up to the board (`protocol.robot.events`)."""
    for command in (b"", b"\xc1", bytes(LONGEST_COMMAND)):
        observation = SAMPLES[0]._replace(command=command)
        assert decode(Observation, encode(observation)).command == command
