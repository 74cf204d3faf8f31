"""Enrolment: how a board asks the plant to be let in, and what it can be told (S2).

Rule 1: the first five fields of a request never change meaning, in any version, so that a plant
        can always say what does not fit.
Rule 2: asking again is harmless. A board repeats its request until it is answered, and again
        whenever another of its links has come up.

Because of Rule 1 these two are flat arrays that begin with their version, and not frames of a
kind; written and read they are by the same codec.
"""

from enum import IntEnum
from typing import Annotated, Any, NamedTuple

import msgspec

from protocol.wire.fields import field, fields
from protocol.wire.frames import (
    FRAME_BYTES_MAX,
    VERSION,
    ProtocolError,
    Reason,
    opened,
    seal,
    shortened,
)


class EnrolmentVerdict(IntEnum):
    """The plant's answer. A board that is refused exits with 10 + this number."""

    ACCEPTED = 0
    WRONG_VERSION = 1
    WRONG_RIG = 2
    UNKNOWN_JOINT = 3
    JOINT_TAKEN = 4
    OTHER_SCENARIO = 5
    RUN_OVER = 6


class EnrolmentRequest(NamedTuple):
    """A board's application, with the anthropometrics of its own link."""

    version: Annotated[int, field("of the board's wire")]
    rig: Annotated[str, field("name of the rig")]
    joint: Annotated[str, field("name of the joint")]
    incarnation: Annotated[int, field("the one granted before; 0 for a board that has just booted")]
    scenario_digest: Annotated[bytes, field("SHA-256 of the resolved scenario, 32 bytes")]
    boot: Annotated[
        int,
        field("random number of this start of the firmware, below 2**63, as in the `@alive` key"),
    ]
    links_up: Annotated[
        int, field("bit n: frames put for the n-th of this board's neighbours will be heard by it")
    ]
    former_run: Annotated[
        int, field("the run in which it last played a tick; 0: none since it booted")
    ]
    mass_kg: Annotated[float, field("of the link above the joint", unit="kg")]
    length_m: Annotated[float, field("its length, joint to joint", unit="m")]
    com_m: Annotated[float, field("from the joint to its centre of mass", unit="m")]
    inertia_kg_m2: Annotated[float, field("about its centre of mass", unit="kg m²")]


class EnrolmentReply(NamedTuple):
    """The plant's answer; `reason` names both sides of a refusal."""

    version: Annotated[int, field("of the plant's wire")]
    verdict: Annotated[int, field("whether the board is let in, else why not")]
    reason: Annotated[str, field("names both sides of a refusal; empty when accepted")]
    run_id: Annotated[int, field("goes into every frame")]
    incarnation: Annotated[int, field("goes into every frame; 0 when refused")]


LASTING = 5
"""Fields of both that never change meaning."""
_NOTHING_ELSE = (0, 0, 0, 0.0, 0.0, 0.0, 0.0)


def _any_version(message: type) -> Any:
    """Read the lasting fields, whatever another version has put behind them."""
    lasting = [(of.name, of.type) for of in fields(message)[:LASTING]]
    prefix = msgspec.defstruct(message.__name__, lasting, array_like=True)
    return msgspec.msgpack.Decoder(prefix)


_encode = msgspec.msgpack.Encoder().encode
_whole_request = msgspec.msgpack.Decoder(EnrolmentRequest)
_any_request, _any_reply = _any_version(EnrolmentRequest), _any_version(EnrolmentReply)


def encode_enrolment(message: EnrolmentRequest | EnrolmentReply) -> bytes:
    """Write a request or a reply, CRC-32 included; a long reason is cut."""
    if isinstance(message, EnrolmentReply):
        message = message._replace(reason=shortened(message.reason))
    payload = seal(_encode(message))
    assert len(payload) <= FRAME_BYTES_MAX, f"an enrolment of {len(payload)} bytes"
    return payload


def decode_request(payload: bytes) -> EnrolmentRequest:
    """Parse a request; of another version, only the fields that never change are read.

    Raises `ProtocolError`.
    """
    body = opened(payload)
    lasting = _read(_any_request, body)
    if lasting[0] != VERSION:
        return EnrolmentRequest._make((*lasting, *_NOTHING_ELSE))
    return EnrolmentRequest._make(_read(_whole_request, body))


def decode_reply(payload: bytes) -> EnrolmentReply:
    """Parse a reply of any version. Raises `ProtocolError`."""
    return EnrolmentReply._make(_read(_any_reply, opened(payload)))


def _read(decoder: Any, body: bytes) -> tuple[Any, ...]:
    try:
        found = decoder.decode(body)
    except (msgspec.DecodeError, ValueError, OverflowError) as error:
        raise ProtocolError(Reason.MALFORMED, f"not of an enrolment: {error}") from error
    return found if isinstance(found, tuple) else msgspec.structs.astuple(found)
