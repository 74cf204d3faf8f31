"""Enrolment messages: the prefix that never changes, other versions, and refusals (S2)."""

from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.wire.enrolment import (
    EnrolmentReply,
    EnrolmentRequest,
    EnrolmentVerdict,
    decode_reply,
    decode_request,
    encode_enrolment,
)
from protocol.wire.frames import FRAME_BYTES_MAX, VERSION, ProtocolError, Reason, seal

LAW = settings(max_examples=100, deadline=None, derandomize=True)
INTS = st.integers(-(2**63), 2**64 - 1)
NAMES = st.text(max_size=16)
REQUESTS = st.builds(
    EnrolmentRequest,
    version=st.just(VERSION),
    rig=NAMES,
    joint=NAMES,
    incarnation=INTS,
    scenario_digest=st.binary(min_size=32, max_size=32),
    boot=INTS,
    links_up=INTS,
    former_run=INTS,
    mass_kg=st.floats(allow_nan=False),
    length_m=st.floats(allow_nan=False),
    com_m=st.floats(allow_nan=False),
    inertia_kg_m2=st.floats(allow_nan=False),
)
REPLIES = st.builds(
    EnrolmentReply,
    version=INTS,
    verdict=INTS,
    reason=st.text(max_size=40),
    run_id=INTS,
    incarnation=INTS,
)
REQUEST = EnrolmentRequest(VERSION, "robot", "knee", 0, bytes(32), 5, 3, 0, 10.0, 0.5, 0.25, 0.2)
REPLY = EnrolmentReply(VERSION, EnrolmentVerdict.ACCEPTED, "", 2**31, 1)


@LAW
@given(REQUESTS, REPLIES)
def test_what_is_written_is_read_back(request: EnrolmentRequest, reply: EnrolmentReply) -> None:
    assert decode_request(encode_enrolment(request)) == request
    assert decode_reply(encode_enrolment(reply)) == reply


@LAW
@given(
    REQUESTS,
    INTS.filter(lambda version: version != VERSION),
    st.lists(st.none() | INTS | st.text(max_size=3) | st.lists(INTS, max_size=2), max_size=6),
)
def test_of_another_version_the_first_five_fields_are_read(
    request: EnrolmentRequest, version: int, rest: list[Any]
) -> None:
    """Whatever that version put behind them, so that the plant can say what does not fit."""
    prefix = (version, *request[1:5])
    decoded = decode_request(seal(msgpack.packb([*prefix, *rest])))
    assert decoded[:5] == prefix
    assert decoded[5:] == (0, 0, 0, 0.0, 0.0, 0.0, 0.0)


def test_the_five_fields_that_never_change() -> None:
    """A change here breaks every board that was ever flashed."""
    assert EnrolmentRequest._fields[:5] == (
        "version",
        "rig",
        "joint",
        "incarnation",
        "scenario_digest",
    )
    assert EnrolmentReply._fields == ("version", "verdict", "reason", "run_id", "incarnation")
    assert [(verdict.value, verdict.name) for verdict in EnrolmentVerdict] == [
        (0, "ACCEPTED"),
        (1, "WRONG_VERSION"),
        (2, "WRONG_RIG"),
        (3, "UNKNOWN_JOINT"),
        (4, "JOINT_TAKEN"),
        (5, "OTHER_SCENARIO"),
        (6, "RUN_OVER"),
    ]


def test_a_reply_of_a_later_version_is_read_as_far_as_it_is_known() -> None:
    payload = seal(msgpack.packb([9, 1, "too old", 2**31, 0, "more", [1, 2]]))
    assert decode_reply(payload) == EnrolmentReply(
        9, EnrolmentVerdict.WRONG_VERSION, "too old", 2**31, 0
    )


@pytest.mark.parametrize("length", range(11))
def test_a_request_of_this_version_has_all_its_fields(length: int) -> None:
    payload = seal(msgpack.packb(list(REQUEST[:length])))
    with pytest.raises(ProtocolError) as refused:
        decode_request(payload)
    assert refused.value.reason is Reason.MALFORMED


@pytest.mark.parametrize("length", range(5))
def test_a_reply_has_all_its_fields(length: int) -> None:
    with pytest.raises(ProtocolError) as refused:
        decode_reply(seal(msgpack.packb(list(REPLY[:length]))))
    assert refused.value.reason is Reason.MALFORMED


@pytest.mark.parametrize("wrong", [None, True, "1", b"1", [1], {}, 1, 1.0])
def test_every_field_has_one_type(wrong: Any) -> None:
    for message, decode in ((REQUEST, decode_request), (REPLY, decode_reply)):
        for i, value in enumerate(message):
            fits = isinstance(value, type(wrong)) and not isinstance(wrong, bool)
            if fits or (isinstance(value, float) and wrong == 1):
                continue  # An int stands for the float that it is.
            fields = [*message[:i], wrong, *message[i + 1 :]]
            with pytest.raises(ProtocolError) as refused:
                decode(seal(msgpack.packb(fields)))
            assert refused.value.reason is Reason.MALFORMED, f"field {i}: {wrong!r}"


def test_the_longest_request_of_a_scenario_fits() -> None:
    """Names have at most 16 characters; every int as long as can be."""
    longest = 2**64 - 1
    request = EnrolmentRequest(
        longest, "r" * 16, "j" * 16, longest, bytes(32), longest, longest, longest, *[1e-300] * 4
    )
    assert len(encode_enrolment(request)) <= FRAME_BYTES_MAX
