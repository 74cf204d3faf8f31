"""Asking to be let in: what is asked, and when a board gives up a session that brings no answer."""

import pytest

from deploy.scenario_file.load import load
from module_agent.firmware.config import board_config
from module_agent.firmware.enrolling import (
    UNANSWERED_S,
    UNANSWERED_S_MAX,
    Enrolling,
    FinishedError,
    UnansweredError,
)
from protocol.process.exit_codes import refused
from protocol.wire.enrolment import (
    EnrolmentReply,
    EnrolmentVerdict,
    decode_request,
    encode_enrolment,
)
from protocol.wire.frames import VERSION

EVERY_S = 0.125


def knee() -> Enrolling:
    scenario = load("paper")
    return Enrolling(board_config(scenario, "knee"), scenario, rig="robot")


def ask(one: Enrolling, now_s: float) -> bytes:
    return one.request(0, boot=7, links_up=[False, True], now_s=now_s)


def silence_s(one: Enrolling, since_s: float) -> float:
    """How long a board asks without an answer before it wants another session."""
    asked = 0
    while True:
        try:
            ask(one, since_s + asked * EVERY_S)
        except UnansweredError:
            return asked * EVERY_S
        asked += 1


def reply(verdict: EnrolmentVerdict, reason: str = "") -> bytes:
    return encode_enrolment(EnrolmentReply(VERSION, verdict, reason, 2**31, 3))


def test_what_is_asked() -> None:
    asked = decode_request(ask(knee(), 5.0))
    assert (asked.joint, asked.rig, asked.boot, asked.links_up) == ("knee", "robot", 7, 0b10)


def test_without_an_answer_it_wants_another_session_ever_more_rarely() -> None:
    """There may be no plant at all yet; then nothing is won by it."""
    one, now_s, waited = knee(), 100.0, []
    for _ in range(8):
        waited.append(silence_s(one, now_s))
        now_s += waited[-1] + EVERY_S
    assert waited[:4] == [wait_s + EVERY_S for wait_s in (2.0, 4.0, 8.0, 16.0)]
    assert waited[-1] == waited[-2] == UNANSWERED_S_MAX + EVERY_S


def test_an_answer_ends_the_wait() -> None:
    one = knee()
    for n in range(10):
        ask(one, n * 1.0)
        assert one.answer(reply(EnrolmentVerdict.ACCEPTED)).incarnation == 3
    assert silence_s(one, 10.0) == UNANSWERED_S + EVERY_S


def test_who_asks_now_and_then_only_has_not_waited() -> None:
    """As a board that ticks, and tells of a link that has come up; or one that was stopped."""
    one = knee()
    asked = [ask(one, n * 30.0) for n in range(100)]
    assert len(set(asked)) == 1
    assert silence_s(one, 3000.0) == UNANSWERED_S + EVERY_S


def test_a_refusal_ends_its_part() -> None:
    with pytest.raises(FinishedError, match="refused: taken") as finished:
        knee().answer(reply(EnrolmentVerdict.JOINT_TAKEN, "taken"))
    assert finished.value.code == refused(EnrolmentVerdict.JOINT_TAKEN)
