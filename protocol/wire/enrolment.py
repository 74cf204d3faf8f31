"""Enrolment: how a board asks the plant to be let in, and what it can be told (S2).

Rule 1: the first five fields of a request never change meaning, in any version, so that a plant
        can always say what does not fit.
Rule 2: asking again is harmless. A board repeats its request until it is answered, and again
        whenever another of its links has come up.
"""

from enum import IntEnum
from typing import NamedTuple

import msgpack

from protocol.wire.frames import (
    FRAME_BYTES_MAX,
    VERSION,
    ProtocolError,
    Reason,
    seal,
    shortened,
    unseal,
)


class Verdict(IntEnum):
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

    version: int
    rig: str
    joint: str
    incarnation: int
    """The incarnation that it was granted before; 0 for a board that has just booted."""
    scenario_digest: bytes
    """SHA-256 of the resolved scenario."""
    boot: int
    """Random number of this start of the firmware: it names the process behind a joint."""
    links_up: int
    """Bit n: frames put for neighbour n (counted from the ground) will be heard by it."""
    former_run: int
    """The run in which it last took part; 0: none since it booted."""
    mass_kg: float
    length_m: float
    com_m: float
    inertia_kg_m2: float


class EnrolmentReply(NamedTuple):
    """The plant's answer; `reason` names both sides of a refusal."""

    version: int
    verdict: int
    reason: str
    run_id: int
    incarnation: int


_REQUEST_TYPES = (int, str, str, int, bytes, int, int, int, float, float, float, float)
_REPLY_TYPES = (int, int, str, int, int)
_FIXED_TYPES = _REQUEST_TYPES[:5]
_NOTHING_ELSE = (0, 0, 0, 0.0, 0.0, 0.0, 0.0)


def encode_enrolment(message: EnrolmentRequest | EnrolmentReply) -> bytes:
    """Write a request or a reply, CRC-32 included; a long reason is cut."""
    if isinstance(message, EnrolmentReply):
        message = message._replace(reason=shortened(message.reason))
    payload = seal(msgpack.packb(tuple(message)))
    assert len(payload) <= FRAME_BYTES_MAX, f"an enrolment of {len(payload)} bytes"
    return payload


def decode_request(payload: bytes) -> EnrolmentRequest:
    """Parse a request; of another version, only the five fields that never change are read.

    Raises `ProtocolError`.
    """
    fields = unseal(payload)
    if tuple(map(type, fields[:5])) != _FIXED_TYPES:
        raise ProtocolError(Reason.MALFORMED, "not an enrolment request")
    if fields[0] != VERSION:
        return EnrolmentRequest._make((*fields[:5], *_NOTHING_ELSE))
    if tuple(map(type, fields)) != _REQUEST_TYPES:
        raise ProtocolError(Reason.MALFORMED, "not an enrolment request of this version")
    return EnrolmentRequest(*fields)


def decode_reply(payload: bytes) -> EnrolmentReply:
    """Parse a reply of any version that keeps these five fields. Raises `ProtocolError`."""
    fields = unseal(payload)
    if tuple(map(type, fields[:5])) != _REPLY_TYPES:
        raise ProtocolError(Reason.MALFORMED, "not an enrolment reply")
    return EnrolmentReply(*fields[:5])
