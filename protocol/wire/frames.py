"""Frames: what is on the wire, byte for byte (`protocol/README.md` is the specification).

Rule 1: a frame is a msgpack array `[version, kind, [field, ...]]` and its CRC-32, in 256 bytes.
Rule 2: a receiver trusts nothing. What does not fit raises `ProtocolError` with one reason.
Rule 3: every field has one type. A float is never sent as an int, so a frame keeps its size.

A field that may be absent has a value that cannot occur instead of a null (`NO_TICK`). To add a
kind: its class, its number in `KINDS`, and its table and a vector in the specification. One that
is for the recording alone also stands in `Report`: it is then recorded, and is in `run.mcap`.
"""

from enum import StrEnum
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar
from zlib import crc32

import msgspec

from protocol.robot.sensors import Readings
from protocol.robot.states import COUNTERS, ON_WIRE, FaultCode
from protocol.wire.fields import field, without_bounds
from protocol.wire.timing import INT64_MAX, Timing
from protocol.wire.trace import LastWord, Trace

VERSION: Final = 2
FRAME_BYTES_MAX = 256
CRC_BYTES = 4
_RESIDUE = 0x2144DF1C
"""The CRC-32 of anything that ends with its own CRC-32, little-endian."""

NO_TICK = -(2**31)
TICK_MAX = 2**31 - 1
NO_EPOCH = -1
MAGNITUDE_MAX = 1e6
"""No length, mass, angle, rate or urgency of a body reaches this."""
UNHEARD_TICKS_MAX = 255
"""The echo of a neighbour is not counted beyond this."""
TEXT_BYTES_MAX = 200
FAULT_TEXT_BYTES_MAX = 160
FAULT_PARTS_MAX = 10


class Reason(StrEnum):
    """Why a frame was refused, in the order in which a receiver checks."""

    SIZE = "size"
    CORRUPT = "corrupt"
    VERSION = "version"
    MALFORMED = "malformed"
    RUN = "run"
    INCARNATION = "incarnation"
    EPOCH = "epoch"
    TICK = "tick"
    RANGE = "range"


class ProtocolError(Exception):
    """A peer sent something that cannot be used."""

    def __init__(self, reason: Reason, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason


RunId = Annotated[int, field("the run, as granted at enrolment; 2**31 to 2**32 - 1")]
OfSender = Annotated[int, field("of the sender, from 1")]
_MAGNITUDE = {"ge": -MAGNITUDE_MAX, "le": MAGNITUDE_MAX}


class Neighbour(NamedTuple):
    """What the plant tells a board of one mechanical neighbour (an entry of the roster)."""

    incarnation: Annotated[int, field("who is there; 0: nobody")]
    completed_tick: Annotated[
        int,
        field(
            "the last tick whose torque of this neighbour reached the plant, later frames are void;"
            " NO_TICK: none yet"
        ),
    ]
    waits: Annotated[int, field("1: wait for its frame before ticking; 0: do not")]


class Observation(NamedTuple):
    """Plant to one board: its own sensors at the start of a tick, and who its neighbours are."""

    run_id: RunId
    incarnation: Annotated[
        int,
        field("of the board that is addressed, from 1; another one has been replaced and stops"),
    ]
    tick: Annotated[int, field("below 0 in warm-up; tick 0 releases the body")]
    readings: Annotated[Readings, field("what its own sensors say")]
    command: Annotated[bytes, field("a board command to obey in this tick; empty: none")]
    neighbours: Annotated[
        tuple[Neighbour, ...], field("the roster: each neighbour of the board, the lower one first")
    ]


class LinkFrame(NamedTuple):
    """Board to one mechanical neighbour, once a tick: a consensus round and the body it knows of.

    The two boards share the joint of the upper one, and `lower_link_*` is the link below that
    joint: told from above it comes from the IMU, told from below by encoders from the foot up.
    Mass and centre of mass are those of everything above the shared joint, seen from that joint;
    they are 0 in a frame that goes up.
    """

    run_id: RunId
    incarnation: OfSender
    tick: Annotated[int, field("in which it is sent")]
    heard_tick: Annotated[
        int, field("newest tick of a frame used from the addressee; NO_TICK: none yet")
    ]
    epoch: Annotated[
        int, field("epoch of the election; NO_EPOCH: none, and the next three fields mean nothing")
    ]
    round: Annotated[int, field("rounds of max-consensus ended in this epoch, 0 to R")]
    urgency: Annotated[
        float,
        field(
            "largest |error| of a controlled variable known in this epoch, the paper's w",
            unit="rad",
            ge=0,
            le=MAGNITUDE_MAX,
        ),
    ]
    candidate: Annotated[
        int, field("board whose urgency that is, 0 is the lowest, boards - 1 the highest", ge=0)
    ]
    sample_tick: Annotated[
        int,
        field("when the values below were sampled; NO_TICK: they then mean nothing and are 0"),
    ]
    lower_link_rad: Annotated[
        float, field("orientation in space of the lower link", unit="rad", **_MAGNITUDE)
    ]
    lower_link_rad_s: Annotated[float, field("its rate", unit="rad/s", **_MAGNITUDE)]
    mass_kg: Annotated[
        float,
        field(
            "all that the shared joint carries; 0 in a frame that goes up, as all below",
            unit="kg",
            ge=0,
            le=MAGNITUDE_MAX,
        ),
    ]
    com_x_m: Annotated[
        float, field("its centre of mass from the shared joint, forward", unit="m", **_MAGNITUDE)
    ]
    com_y_m: Annotated[float, field("upward", unit="m", **_MAGNITUDE)]
    com_x_m_s: Annotated[
        float,
        field(
            "velocity of that centre of mass relative to the shared joint, in space, forward",
            unit="m/s",
            **_MAGNITUDE,
        ),
    ]
    com_y_m_s: Annotated[float, field("upward", unit="m/s", **_MAGNITUDE)]


class LinkUse(NamedTuple):
    """A board's receipt, per neighbour: what it used of the link in this tick, and what it sent."""

    heard_mask: Annotated[
        int, field("bit j: the neighbour's frame sent in tick - 1 - j was used in this tick", ge=0)
    ]
    sent_crc: Annotated[
        int,
        field(
            "CRC-32 of the link frame sent to this neighbour in this tick, its last four bytes",
            ge=0,
            le=2**32 - 1,
        ),
    ]
    unheard_ticks: Annotated[
        int,
        field(
            "tick - 1 - heard_tick of the newest frame heard from this neighbour: how long it"
            " has not heard this board; 0 until one is heard",
            ge=0,
            le=UNHEARD_TICKS_MAX,
        ),
    ]


class TorqueFrame(NamedTuple):
    """Board to plant, once a tick: the torque, what the board is doing, and its receipts."""

    run_id: RunId
    incarnation: OfSender
    tick: Annotated[int, field("of the observation that this answers")]
    torque_nm: Annotated[
        float,
        field("asked of the joint; positive turns the link above forward", unit="N m"),
    ]
    state: Annotated[
        int,
        field(
            ", ".join(f"{state.value} {state.name.lower()}" for state in ON_WIRE)
            + "; torque 0 in 1, 6 and 7",
            ge=int(min(ON_WIRE)),
            le=int(max(ON_WIRE)),
        ),
    ]
    enabled: Annotated[int, field("the enabling variable y: 1 moves, 0 holds", ge=0, le=1)]
    controlled_rad: Annotated[
        float,
        field(
            "controlled variable alpha that the servo used, sampled one lumped delay ago; 0 while"
            " syncing",
            unit="rad",
        ),
    ]
    epoch: Annotated[
        int,
        field("as in the link frames of this tick, as the next three", ge=NO_EPOCH, le=TICK_MAX),
    ]
    round: Annotated[int, field("rounds of max-consensus ended in it", ge=0, le=TICK_MAX)]
    urgency: Annotated[float, field("largest |error| known in it", unit="rad")]
    candidate: Annotated[int, field("board whose urgency that is, 0 is the lowest", ge=0)]
    counter: Annotated[
        int,
        field(
            "which counter the next field tells: tick modulo their number, not negative",
            ge=0,
            le=len(COUNTERS) - 1,
        ),
    ]
    counted: Annotated[int, field("its value, since the board began", ge=0, le=INT64_MAX)]
    links: Annotated[
        tuple[LinkUse, ...], field("receipts: one for each neighbour, the lower one first")
    ]


def shortened(text: str) -> str:
    """Cut a text for people so that it fits into a frame."""
    encoded = text.encode()
    if len(encoded) <= TEXT_BYTES_MAX:
        return text
    return encoded[: TEXT_BYTES_MAX - 3].decode(errors="ignore") + "..."


class End(NamedTuple):
    """Plant to every board: the run is over, go home."""

    run_id: RunId
    reason: Annotated[str, field("why the run is over, for the user")]


class StallReport(NamedTuple):
    """Board to plant: it cannot tick, because a neighbour's frame is not there (S6)."""

    run_id: RunId
    incarnation: Annotated[int, field("of the board that waits")]
    tick: Annotated[
        int, field("the tick it cannot play; the frame it waits for was sent in the tick before")
    ]
    sender: Annotated[
        int,
        field(
            "number of the board whose frame that is; the board's own: it does not come back from"
            " something"
        ),
    ]


class Fault(NamedTuple):
    """Board to plant, before the torque of the tick in which it entered state `FAULT`."""

    run_id: RunId
    incarnation: Annotated[int, field("of the board that has failed")]
    tick: Annotated[int, field("in which it failed")]
    code: Annotated[
        int, field("what has failed (section 13)", ge=int(min(FaultCode)), le=int(max(FaultCode)))
    ]
    part: Annotated[
        int,
        field(
            "which part of the text this is, below `parts`; they come in this order",
            ge=0,
            le=FAULT_PARTS_MAX - 1,
        ),
    ]
    parts: Annotated[int, field("how many there are", ge=1, le=FAULT_PARTS_MAX)]
    text: Annotated[
        str,
        field("for people: printable, and line feeds; the parts put together are the text"),
    ]


AnyFrame = (
    Observation | LinkFrame | TorqueFrame | End | StallReport | Timing | Fault | Trace | LastWord
)
Frame = TypeVar("Frame", bound=AnyFrame)

KINDS: dict[type, int] = {
    Observation: 1,
    LinkFrame: 2,
    TorqueFrame: 3,
    End: 4,
    StallReport: 5,
    Timing: 6,
    Fault: 7,
    Trace: 8,
    LastWord: 9,
}

Report = Timing
"""What a board tells for the recording alone: the union of these kinds. Each begins with the run,
the incarnation and the tick that it is of, or the first of its `ticks`; no tick is told twice."""
REPORTS: tuple[type[Report], ...] = (Report,)


def report_name(kind: type[Report]) -> str:
    """What ends the key of a report, and the channel that it is recorded on."""
    return kind.__name__.lower()


_encode = msgspec.msgpack.Encoder().encode


def _decoder(kind: int, fields: Any) -> Any:
    return msgspec.msgpack.Decoder(tuple[Literal[VERSION], Literal[kind], fields])  # type: ignore[valid-type]


_decoders = {frame: _decoder(kind, frame) for frame, kind in KINDS.items()}
_lenient = {frame: _decoder(kind, without_bounds(frame)) for frame, kind in KINDS.items()}
_array = msgspec.msgpack.Decoder(tuple[Any, ...])


class _Head(msgspec.Struct, array_like=True):
    """What every frame begins with."""

    version: int
    kind: int


_head = msgspec.msgpack.Decoder(_Head)


def version_trouble(version: object) -> str | None:
    """Why a recording of a version cannot be read, and what to do; None if it can."""
    if version == VERSION:
        return None
    return (
        f"it was recorded with version {version} of the wire, and this decmesh reads version"
        f" {VERSION}; read it with the decmesh that recorded it"
    )


def seal(body: bytes) -> bytes:
    """Append the CRC-32 of `body`, little-endian."""
    return body + crc32(body).to_bytes(CRC_BYTES, "little")


def opened(payload: bytes) -> bytes:
    """Check size and CRC-32, and return what precedes it."""
    if not CRC_BYTES < len(payload) <= FRAME_BYTES_MAX:
        raise ProtocolError(Reason.SIZE, f"{len(payload)} bytes")
    if crc32(payload) != _RESIDUE:
        raise ProtocolError(Reason.CORRUPT, f"CRC-32 of {len(payload)} bytes does not match")
    return payload[:-CRC_BYTES]


def unseal(payload: bytes) -> tuple[Any, ...]:
    """Check size and CRC-32 and return the array within, of whatever version it is."""
    return _elements(opened(payload))


def _elements(body: bytes) -> tuple[Any, ...]:
    try:
        elements = _array.decode(body)
    except (msgspec.DecodeError, ValueError, OverflowError) as error:
        raise ProtocolError(Reason.MALFORMED, f"not an array: {error}") from error
    if not elements:
        raise ProtocolError(Reason.MALFORMED, "not an array with a version")
    return elements


def kind_of(payload: bytes) -> type | None:
    """Which kind of frame this is, if any. Raises `ProtocolError`."""
    try:
        head = _head.decode(opened(payload))
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    return next((frame for frame, number in KINDS.items() if number == head.kind), None)


def encode(frame: AnyFrame) -> bytes:
    """Write one frame, CRC-32 included."""
    payload = seal(_encode((VERSION, KINDS[type(frame)], frame)))
    assert len(payload) <= FRAME_BYTES_MAX, f"{type(frame).__name__} of {len(payload)} bytes"
    return payload


def decode(expected: type[Frame], payload: bytes) -> Frame:
    """Parse one frame of a known kind, or raise `ProtocolError` with the first reason that fits.

    A float that has no bounds may be a NaN: what that means is up to the receiver.
    """
    frame: Frame
    body = opened(payload)
    try:
        _, _, frame = _decoders[expected].decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise _refusal(expected, body, error)[1] from error
    return frame


def receive(expected: type[Frame], payload: bytes) -> tuple[Frame, ProtocolError | None]:
    """Parse as `decode`, but give the frame also where a field is out of range, with the error.

    For a receiver that has other reasons to look for, since range is the last of them. Such a frame
    is good for that alone.
    """
    frame: Frame
    body = opened(payload)
    try:
        _, _, frame = _decoders[expected].decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        out_of_range, refusal = _refusal(expected, body, error)
        if out_of_range is None:
            raise refusal from error
        return out_of_range, refusal
    return frame, None


def _refusal(
    expected: type[Frame], body: bytes, error: Exception
) -> tuple[Frame | None, ProtocolError]:
    """Why a frame is refused, and the frame itself if nothing but its numbers is wrong."""
    try:
        _, _, fields = _lenient[expected].decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError):
        version = _elements(body)[0]
        if version != VERSION:
            detail = f"version {version!r}, this is version {VERSION}"
            return None, ProtocolError(Reason.VERSION, detail)
        detail = f"not a {expected.__name__}: {error}"
        return None, ProtocolError(Reason.MALFORMED, detail)
    frame: Any = expected._make(fields)
    return frame, ProtocolError(Reason.RANGE, f"{expected.__name__}: {error}")


def decode_report(payload: bytes) -> Report:
    """Parse a report of any kind, as `decode`."""
    kind = kind_of(payload)
    for report in REPORTS:
        if report is kind:
            return decode(report, payload)
    raise ProtocolError(Reason.MALFORMED, "not a report")
