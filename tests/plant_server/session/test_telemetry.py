"""What boards tell of themselves: counters, and why they have failed."""

from typing import Any

import pytest

from protocol.robot.states import COUNTERS, Counters, FaultCode, State
from protocol.wire.frames import FAULT_PARTS_MAX, Fault, Reason, encode
from tests.plant_server.plant import (
    BRAKED,
    HIP,
    KNEE,
    OTHER_RUN,
    RUN,
    finish,
    happened,
    opened,
    plant,
    play,
    reply,
    torque_frame,
)

PART = Fault(RUN, 1, 0, 2, 0, 1, "torque_nm answered nan, which is no finite number")


def test_counters_are_kept_as_they_come_one_a_tick() -> None:
    lockstep = plant()
    for tick in range(2 * len(COUNTERS)):
        opened(lockstep)
        place = tick % len(COUNTERS)
        frame = torque_frame(tick, board=KNEE)._replace(counter=place, counted=100 * tick + place)
        lockstep.answer(KNEE, encode(frame))
        finish(lockstep)
    expected = [100 * tick + tick % len(COUNTERS) for tick in range(2 * len(COUNTERS))]
    assert lockstep.plant.telemetry.counters(KNEE) == Counters(*expected[len(COUNTERS) :])
    assert lockstep.plant.telemetry.counters(HIP) == Counters()
    lockstep.remove(KNEE, "died")
    assert lockstep.plant.telemetry.counters(KNEE) == Counters(), "another board counts anew"


def test_a_failure_is_recorded_when_all_of_it_is_here() -> None:
    """In the tick in which it is told; said again it is not told twice."""
    lockstep = plant()
    opened(lockstep)
    for part in range(3):
        assert lockstep.plant.telemetry.failures[KNEE] is None
        payload = encode(PART._replace(part=part, parts=3, text=f"line {part}\n"))
        whole = lockstep.report(KNEE, payload)
        assert (whole is not None) == (part == 2)
        assert lockstep.report(KNEE, payload) is None
    record = finish(lockstep)
    assert happened(record, "fault") == [[KNEE, 2, "line 0\nline 1\nline 2\n"]]
    failure = lockstep.plant.telemetry.failures[KNEE]
    assert failure == (FaultCode.CONTROLLER_NO_TORQUE, "line 0\nline 1\nline 2\n")
    assert str(failure) == "fault 2 (controller no torque), line 0"
    assert play(lockstep).events == ()
    assert not lockstep.plant.refused
    lockstep.remove(KNEE, "unplugged")
    assert lockstep.plant.telemetry.failures[KNEE] is None


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"run_id": OTHER_RUN}, Reason.RUN),
        ({"incarnation": 2}, Reason.INCARNATION),
        ({"incarnation": 0}, Reason.INCARNATION),
        ({"tick": 1}, Reason.TICK),
        ({"tick": -1}, Reason.TICK),
        ({"code": 0}, Reason.RANGE),
        ({"code": 99}, Reason.RANGE),
        ({"part": -1}, Reason.RANGE),
        ({"part": 1}, Reason.RANGE),
        ({"parts": FAULT_PARTS_MAX + 1}, Reason.RANGE),
        ({"text": "\x1b[2J"}, Reason.RANGE),
    ],
)
def test_what_cannot_be_a_report_is_refused(changes: dict[str, Any], reason: Reason) -> None:
    lockstep = plant()
    opened(lockstep)
    assert lockstep.report(KNEE, encode(PART._replace(**changes))) is None
    assert lockstep.plant.refused == {reason: 1}
    assert lockstep.plant.telemetry.refused[KNEE] == {reason: 1}
    assert lockstep.plant.telemetry.failures[KNEE] is None
    assert happened(finish(lockstep), "fault") == []


def test_parts_that_are_missing_make_no_report() -> None:
    lockstep = plant()
    opened(lockstep)
    lockstep.report(KNEE, encode(PART._replace(part=1, parts=2)))
    assert lockstep.plant.telemetry.failures[KNEE] is None
    assert lockstep.report(KNEE, b"rubbish") is None
    assert lockstep.plant.refused == {Reason.CORRUPT: 1}


def test_nobody_reports_for_a_joint_without_a_board() -> None:
    lockstep = plant(here=(HIP,))
    opened(lockstep)
    lockstep.report(KNEE, encode(PART._replace(incarnation=0)))
    assert lockstep.plant.refused == {Reason.INCARNATION: 1}


def test_a_joint_whose_new_board_fails_at_once_stays_as_it_was() -> None:
    """S17: it is braked until somebody drives it; a board that has driven lets go instead."""
    lockstep = plant(unattended=BRAKED)
    play(lockstep)
    lockstep.remove(KNEE, "unplugged")
    play(lockstep)
    lockstep.plant.admit(KNEE, 2)
    for state in (State.SYNCING, State.FAULT, State.FAULT):
        opened(lockstep)
        reply(lockstep, KNEE, 0.0, state)
        finish(lockstep)
        (undriven,) = lockstep.plant.outcome(0.0).undriven
        assert (undriven.joint, undriven.has_board) == ("knee", True)
    opened(lockstep)
    reply(lockstep, HIP, 0.0, State.FAULT)
    finish(lockstep)
    assert [joint.joint for joint in lockstep.plant.outcome(0.0).undriven] == []
