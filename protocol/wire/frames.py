"""Frames: what is on the wire, byte for byte (`protocol/README.md` is the specification).

Rule 1: a frame is a msgpack array `[version, kind, [field, ...]]` and its CRC-32, in 256 bytes.
Rule 2: a receiver trusts nothing. What does not fit raises `ProtocolError` with one reason.
Rule 3: every field has one type. A float is never sent as an int, so a frame keeps its size.

A field that may be absent has a value that cannot occur instead of a null (`NO_TICK`).
"""

from enum import StrEnum
from typing import Any, Literal, NamedTuple, TypeVar
from zlib import crc32

import msgpack
import msgspec

from protocol.robot.sensors import Readings
from protocol.wire.timing import Timing

VERSION = 1
FRAME_BYTES_MAX = 256
CRC_BYTES = 4
_RESIDUE = 0x2144DF1C
"""The CRC-32 of anything that ends with its own CRC-32, little-endian."""

NO_TICK = -(2**31)
TICK_MAX = 2**31 - 1
NO_EPOCH = -1


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


class Neighbour(NamedTuple):
    """What the plant tells a board of one mechanical neighbour (an entry of the roster)."""

    incarnation: int
    """0: nobody is there."""
    completed_tick: int
    """The last tick whose torque reached the plant; later frames of this sender are void."""
    waits: int
    """1: the board waits for this neighbour's frame before it ticks."""


class Observation(NamedTuple):
    """Plant to one board: its own sensors at the start of a tick, and who its neighbours are."""

    run_id: int
    incarnation: int
    """Of the board that is addressed. Another one has been replaced and stops."""
    tick: int
    """Negative during warm-up; 0 releases the body."""
    readings: Readings
    """An array of its own; a sensor that the board does not have says 0."""
    command: bytes
    """A `protocol.robot.commands.BoardCommand` to obey in this tick; empty: none."""
    neighbours: tuple[Neighbour, ...]


class LinkFrame(NamedTuple):
    """Board to one mechanical neighbour, once a tick: a consensus round and the body it knows of.

    The two boards share the joint of the upper one, and `lower_link_*` is the link below that
    joint: told from above it comes from the IMU, told from below by encoders from the foot up.
    Mass and centre of mass are those of everything above the shared joint, seen from that joint;
    they are 0 in a frame that goes up.
    """

    run_id: int
    incarnation: int
    tick: int
    heard_tick: int
    """The newest tick heard from the addressee: how it learns of a one-way link."""
    epoch: int
    round: int
    urgency: float
    """Largest |error of the controlled variable| known in this epoch (the paper's w)."""
    candidate: int
    """Index of the board whose urgency that is."""
    sample_tick: int
    """When the values below were sampled (`NO_TICK`: there are none)."""
    lower_link_rad: float
    lower_link_rad_s: float
    mass_kg: float
    com_x_m: float
    com_y_m: float
    com_x_m_s: float
    com_y_m_s: float


class LinkUse(NamedTuple):
    """A board's receipt, per neighbour: what it used of the link in this tick, and what it sent."""

    heard_mask: int
    """Bit j: the frame said in tick k-1-j was used in tick k."""
    sent_crc: int
    """CRC-32 of the link frame sent to this neighbour in this tick."""
    unheard_ticks: int
    """How many ticks ago this neighbour last heard the board, by its own echo."""


class TorqueFrame(NamedTuple):
    """Board to plant, once a tick: the torque, what the board is doing, and its receipts."""

    run_id: int
    incarnation: int
    tick: int
    torque_nm: float
    state: int
    """A `protocol.robot.states.State`."""
    enabled: int
    """The paper's enabling variable y: 1 moves, 0 holds."""
    controlled_rad: float
    """The controlled variable alpha that the servo used (sampled one lumped delay ago)."""
    epoch: int
    round: int
    urgency: float
    candidate: int
    counter: int
    """Which of `protocol.robot.states.COUNTERS` this frame tells."""
    counted: int
    links: tuple[LinkUse, ...]


TEXT_BYTES_MAX = 200


def shortened(text: str) -> str:
    """Cut a text for people so that it fits into a frame."""
    encoded = text.encode()
    if len(encoded) <= TEXT_BYTES_MAX:
        return text
    return encoded[: TEXT_BYTES_MAX - 3].decode(errors="ignore") + "..."


class End(NamedTuple):
    """Plant to every board: the run is over, go home."""

    run_id: int
    reason: str


class Stalled(NamedTuple):
    """Board to plant: it cannot tick, because a neighbour's frame is not there (S6)."""

    run_id: int
    incarnation: int
    tick: int
    """The tick that waits; the frame is of the tick before."""
    sender: int
    """Index of the board whose frame it is."""


class Fault(NamedTuple):
    """Board to plant, before the torque of the tick in which it entered state `FAULT`."""

    run_id: int
    incarnation: int
    tick: int
    code: int
    """A `protocol.robot.states.FaultCode`."""
    part: int
    """Which part of the text this is, from 0."""
    parts: int
    """How many there are, 1 to `FAULT_PARTS_MAX`."""
    text: str
    """What went wrong and where, for people; parts are put together as they are."""


FAULT_TEXT_BYTES_MAX = 160
FAULT_PARTS_MAX = 10

AnyFrame = Observation | LinkFrame | TorqueFrame | End | Stalled | Timing | Fault
Frame = TypeVar("Frame", bound=AnyFrame)

KINDS: dict[type, int] = {
    Observation: 1,
    LinkFrame: 2,
    TorqueFrame: 3,
    End: 4,
    Stalled: 5,
    Timing: 6,
    Fault: 7,
}

_encode = msgspec.msgpack.Encoder().encode
_decoders: dict[type, Any] = {
    frame: msgspec.msgpack.Decoder(tuple[Literal[VERSION], Literal[kind], frame])  # type: ignore[valid-type]
    for frame, kind in KINDS.items()
}


def seal(body: bytes) -> bytes:
    """Append the CRC-32 of `body`, little-endian."""
    return body + crc32(body).to_bytes(CRC_BYTES, "little")


def _unsealed(payload: bytes) -> bytes:
    """Check size and CRC-32, and return what precedes it."""
    if not CRC_BYTES < len(payload) <= FRAME_BYTES_MAX:
        raise ProtocolError(Reason.SIZE, f"{len(payload)} bytes")
    if crc32(payload) != _RESIDUE:
        raise ProtocolError(Reason.CORRUPT, f"CRC-32 of {len(payload)} bytes does not match")
    return payload[:-CRC_BYTES]


def unseal(payload: bytes) -> tuple[Any, ...]:
    """Check size and CRC-32 and return the array within, of whatever version it is."""
    body = _unsealed(payload)
    try:
        fields = msgpack.unpackb(body, use_list=False)
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
        raise ProtocolError(Reason.MALFORMED, f"not msgpack: {error}") from error
    if type(fields) is not tuple or not fields:
        raise ProtocolError(Reason.MALFORMED, "not an array with a version")
    return fields


def encode(frame: AnyFrame) -> bytes:
    """Write one frame, CRC-32 included."""
    payload = seal(_encode((VERSION, KINDS[type(frame)], frame)))
    assert len(payload) <= FRAME_BYTES_MAX, f"{type(frame).__name__} of {len(payload)} bytes"
    return payload


def decode(expected: type[Frame], payload: bytes) -> Frame:
    """Parse one frame of a known kind, or raise `ProtocolError` with the first reason that fits.

    Numbers are checked for their type, not for their value: what a NaN means is up to the receiver.
    """
    frame: Frame
    try:
        _, _, frame = _decoders[expected].decode(_unsealed(payload))
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        version = unseal(payload)[0]
        if version != VERSION:
            raise ProtocolError(
                Reason.VERSION, f"version {version!r}, this is version {VERSION}"
            ) from None
        raise ProtocolError(Reason.MALFORMED, f"not a {expected.__name__}: {error}") from error
    return frame
