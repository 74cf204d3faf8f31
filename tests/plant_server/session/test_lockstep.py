"""The barrier and what it lets through: answers are a set, and no answer can hurt the body."""

from collections import Counter
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_server.session.record import COMPLETE, FELL, UndrivenJoint, fall_line
from protocol.robot.events import Command, Push
from protocol.robot.hardware import IDEAL, MotorSheet
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_TICK,
    LinkFrame,
    LinkUse,
    Neighbour,
    Reason,
    TorqueFrame,
    encode,
    seal,
)
from tests.plant_server.plant import (
    ANKLE,
    HIP,
    KNEE,
    LIMIT_NM,
    OTHER_RUN,
    PASSIVE,
    POSTURE_RAD,
    RUN,
    answer,
    finish,
    happened,
    opened,
    plant,
    play,
    reply,
    torque_frame,
)


def unusable(tick: int, board: int) -> list[tuple[Reason, bytes]]:
    """Frames that are no answer to `tick`, and why. None of them carries a torque to be seen."""
    good = torque_frame(tick, 40.0 + board, board=board)
    flipped = bytearray(encode(good))
    flipped[5] ^= 0x10
    link = LinkFrame(RUN, 1, tick, NO_TICK, -1, 0, 0.0, 0, NO_TICK, *(0.0,) * 7)
    return [
        (Reason.SIZE, b""),
        (Reason.SIZE, bytes(257)),
        (Reason.CORRUPT, bytes(flipped)),
        (Reason.CORRUPT, encode(good)[:-1]),
        (Reason.MALFORMED, encode(link)),
        (Reason.MALFORMED, seal(b"\xc1")),
        (Reason.VERSION, seal(b"\x92\x63\x03")),
        (Reason.RUN, encode(good._replace(run_id=OTHER_RUN))),
        (Reason.INCARNATION, encode(good._replace(incarnation=2))),
        (Reason.INCARNATION, encode(good._replace(incarnation=0))),
        (Reason.TICK, encode(good._replace(tick=tick - 1))),
        (Reason.TICK, encode(good._replace(tick=tick + 1))),
    ]


@pytest.mark.parametrize("which", range(12))
def test_what_is_no_answer_is_counted_by_its_reason(which: int) -> None:
    """Each reason by itself; the board is still waited for, and its answer still counts."""
    lockstep = plant()
    opened(lockstep)
    reason, payload = unusable(0, 0)[which]
    assert not lockstep.answer(0, payload)
    assert lockstep.plant.refused == Counter({reason: 1})
    assert lockstep.waiting_for == [0, 1, 2]
    assert lockstep.answer(0, answer(0, 1.0))
    assert lockstep.waiting_for == [1, 2]


@pytest.mark.parametrize(
    "impossible",
    [
        {"enabled": 2},
        {
            "enabled": 2**63
        },  # `deploy.recording.trajectory` cannot hold it: OverflowError after the run.
        {"state": 77},
        {"candidate": 3},
        {"candidate": -1},
        {"round": -1},
        {"epoch": 2**31},
        {"counter": 16},  # There are sixteen, from 0.
        {"counted": 2**63},
        {"links": ()},  # Whoever asks for the status would look for what is not there.
        {"links": (LinkUse(1, 0, 0), LinkUse(1, 0, 0))},
    ],
    ids=str,
)
def test_an_answer_with_impossible_numbers_is_refused(impossible: dict[str, Any]) -> None:
    """S1: range is the last of the checks.

    Of whole numbers, which only a mad sender gets wrong. A NaN is what a diverging body makes of
    honest boards; to refuse it would leave the plant waiting.
    """
    lockstep = plant()
    opened(lockstep)
    good = torque_frame(0, 1.0)
    assert not lockstep.answer(0, encode(TorqueFrame(**{**good._asdict(), **impossible})))
    assert lockstep.plant.refused == Counter({Reason.RANGE: 1})


TORQUES_NM = [(7.0, -3.0, 1.0), (6.5, 2.0, -1.0), (-8.0, 0.0, 60.0)]


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_answers_are_a_set(data: st.DataObject) -> None:
    """Order, repetition and anything that is no answer change nothing, to the bit (rule 1)."""
    orderly, chaotic = plant(), plant()
    expected: Counter[Reason] = Counter()
    for tick, torques in enumerate(TORQUES_NM):
        record = play(orderly, *torques)
        opened(chaotic)
        answers = [
            (board, None, answer(tick, torque, board=board)) for board, torque in enumerate(torques)
        ]
        # The last valid answer of a board ends the tick, so noise comes before it.
        noise = [(b, reason, bad) for b in range(3) for reason, bad in unusable(tick, b)]
        repeats = data.draw(st.lists(st.sampled_from(answers), max_size=5))
        heard = data.draw(st.lists(st.sampled_from(noise), max_size=8))
        for board, reason, payload in data.draw(st.permutations([*answers, *repeats, *heard])):
            waited_for = board in chaotic.waiting_for
            assert chaotic.answer(board, payload) == (waited_for and reason is None)
            if reason is not None:
                expected[reason] += 1
        assert not chaotic.waiting_for
        assert chaotic.close() == record
    assert chaotic.plant.refused == expected
    assert chaotic.plant.actuators.saturated == orderly.plant.actuators.saturated == 1
    assert orderly.plant.outcome(0.0) == chaotic.plant.outcome(0.0)


def test_the_first_answer_of_a_tick_stands() -> None:
    """A board that changes its mind within a tick has already said its torque."""
    lockstep = plant()
    opened(lockstep)
    assert lockstep.answer(0, answer(0, 5.0))
    assert not lockstep.answer(0, answer(0, 9.0))
    assert not lockstep.answer(0, answer(0, nan))
    reply(lockstep, KNEE)
    reply(lockstep, HIP)
    assert lockstep.close().torques_nm == (5.0, 0.0, 0.0)
    assert lockstep.plant.actuators.invalid_torques == 0


def test_a_tick_is_not_over_before_everybody_has_answered() -> None:
    lockstep = plant()
    opened(lockstep)
    reply(lockstep, KNEE)
    assert lockstep.waiting_for == [0, 2]
    with pytest.raises(AssertionError):
        lockstep.close()


@pytest.mark.parametrize("number", [nan, inf, -inf])
def test_a_torque_that_is_no_number_is_bridged_for_ten_ticks(number: float) -> None:
    """Then the joint gets none. It is an answer all the same: nobody waits for a better one."""
    lockstep = plant()
    play(lockstep, 12.0, 0.0, 0.0)
    applied = [play(lockstep, number, 0.0, 0.0).torques_nm[0] for _ in range(15)]
    assert applied == [12.0] * 10 + [0.0] * 5
    assert lockstep.plant.actuators.invalid_torques == 15
    assert lockstep.plant.actuators.saturated == 0
    # A valid torque ends it, and the next gap has ten ticks of its own.
    assert play(lockstep, -4.0, 0.0, 0.0).torques_nm[0] == -4.0
    applied = [play(lockstep, number, 0.0, 0.0).torques_nm[0] for _ in range(11)]
    assert applied == [-4.0] * 10 + [0.0]
    assert not lockstep.plant.body.fallen


@pytest.mark.parametrize("hold_ticks", [0, 3])
def test_how_long_it_is_bridged_is_in_the_motors_data_sheet(hold_ticks: int) -> None:
    lockstep = plant(motor_sheets=(MotorSheet(hold_ticks=hold_ticks), IDEAL, IDEAL))
    play(lockstep, 12.0, 12.0, 0.0)
    applied = [play(lockstep, nan, nan, 0.0).torques_nm for _ in range(12)]
    assert [torques[0] for torques in applied] == [12.0] * hold_ticks + [0.0] * (12 - hold_ticks)
    assert [torques[1] for torques in applied] == [12.0] * 10 + [0.0] * 2


def test_a_board_that_never_said_a_number_drives_nothing() -> None:
    lockstep = plant()
    for _ in range(12):
        assert play(lockstep, 0.0, nan, 0.0).torques_nm == (0.0, 0.0, 0.0)


def test_torques_beyond_the_limit_are_saturated_and_counted() -> None:
    """The limit itself is within it; what bridges a gap afterwards is what was applied."""
    lockstep = plant()
    assert play(lockstep, LIMIT_NM, -LIMIT_NM, 0.0).torques_nm == (LIMIT_NM, -LIMIT_NM, 0.0)
    assert lockstep.plant.actuators.saturated == 0
    beyond = play(lockstep, 50.000001, -1e300, 49.9)
    assert beyond.torques_nm == (LIMIT_NM, -LIMIT_NM, 49.9)
    assert lockstep.plant.actuators.saturated == 2
    assert play(lockstep, nan, nan, 0.0).torques_nm == (LIMIT_NM, -LIMIT_NM, 0.0)
    assert lockstep.plant.actuators.saturated == 2


def test_the_body_is_held_through_the_warm_up_and_released_by_tick_zero() -> None:
    """S8: ticks -W to -1, torques answered but not applied, not felt and not recorded."""
    lockstep = plant(warm_up_ticks=4)
    for tick in range(-4, 0):
        assert lockstep.plant.tick == tick
        record = play(lockstep, 30.0, -30.0, 30.0)
        assert record.tick == tick
        assert (record.angles_rad, record.rates_rad_s) == (POSTURE_RAD, (0.0, 0.0, 0.0))
        assert record.torques_nm == (0.0, 0.0, 0.0)
        assert lockstep.plant.body.angles_rad == list(POSTURE_RAD)
        assert lockstep.plant.body.torques_nm == [0.0, 0.0, 0.0]
    record = play(lockstep, 30.0, -30.0, 30.0)
    assert (record.tick, record.torques_nm) == (0, (30.0, -30.0, 30.0))
    assert record.angles_rad == POSTURE_RAD
    assert all(q != q0 for q, q0 in zip(lockstep.plant.body.angles_rad, POSTURE_RAD, strict=True))


def test_the_warm_up_leaves_no_trace() -> None:
    """A run with and one without a warm-up are the same from tick 0, to the bit."""
    with_it, without = plant(warm_up_ticks=7), plant()
    for _ in range(7):
        play(with_it, 30.0, -30.0, 30.0)
    for torques in TORQUES_NM * 5:
        record, other = play(with_it, *torques), play(without, *torques)
        assert record[:-2] == other[:-2]
        assert record.answers == other.answers


def test_a_board_senses_its_own_joint_and_what_it_carries() -> None:
    """Joint sensors everywhere; the IMU in the trunk and the plate under the foot, nowhere else."""
    lockstep = plant()
    play(lockstep, 20.0, -10.0, 5.0)
    body = lockstep.plant.body
    seen = list(opened(lockstep).values())
    for board, observation in enumerate(seen):
        assert (observation.run_id, observation.incarnation, observation.tick) == (RUN, 1, 1)
        assert observation.readings.joint_rad == body.angles_rad[board]
        assert observation.readings.joint_rad_s == body.rates_rad_s[board]
        assert observation.readings.joint_torque_nm == (20.0, -10.0, 5.0)[board]
    assert (
        [o.readings.imu_rad for o in seen[:2]]
        == [o.readings.imu_rad_s for o in seen[:2]]
        == [0.0, 0.0]
    )
    assert seen[2].readings.imu_rad == body.angles_rad[0] + body.angles_rad[1] + body.angles_rad[2]
    assert (
        seen[2].readings.imu_rad_s
        == body.rates_rad_s[0] + body.rates_rad_s[1] + body.rates_rad_s[2]
    )
    assert [(o.readings.foot_force_n, o.readings.foot_cop_m) for o in seen[1:]] == [(0.0, 0.0)] * 2
    assert (seen[0].readings.foot_force_n, seen[0].readings.foot_cop_m) == (
        body.foot_force_n,
        body.foot_cop_m,
    )


def test_a_board_cannot_tell_what_happens_at_other_joints() -> None:
    """Its observation is the same bytes whatever the others' joints do (the knee has neither IMU
    nor force plate)."""
    here, elsewhere = plant(), plant()
    elsewhere.plant.body.angles_rad = [0.7, POSTURE_RAD[1], -0.4]
    elsewhere.plant.body.rates_rad_s = [1.0, 0.0, -2.0]
    elsewhere.plant.body.torques_nm = [9.0, 0.0, -9.0]
    elsewhere.plant.body.foot_force_n = 1.0
    mine, other = list(here.open()), list(elsewhere.open())
    assert mine[1] == other[1]
    assert mine[0] != other[0]
    assert mine[2] != other[2]


def test_the_roster_names_mechanical_neighbours_only() -> None:
    """And the last tick that each of them has completed (S5)."""
    lockstep = plant()
    before = opened(lockstep).values()
    assert [len(o.neighbours) for o in before] == [1, 2, 1]
    assert {n for o in before for n in o.neighbours} == {Neighbour(1, NO_TICK, 1)}
    finish(lockstep)
    assert {n for o in opened(lockstep).values() for n in o.neighbours} == {Neighbour(1, 0, 1)}


def test_a_run_has_its_ticks() -> None:
    lockstep = plant(warm_up_ticks=2, ticks=3)
    records = []
    while not lockstep.plant.over:
        records.append(play(lockstep, -20.0, -10.0, -10.0))
    assert [record.tick for record in records] == [-2, -1, 0, 1, 2]
    outcome = lockstep.plant.outcome(0.5)
    assert (outcome.tick, outcome.ending, outcome.wall_s) == (3, COMPLETE, 0.5)
    assert outcome.angles_rad == tuple(lockstep.plant.body.angles_rad)


def test_a_fall_ends_the_run_and_says_so() -> None:
    """S21, and it is the reason that is given even when the run was cut short."""
    lockstep = plant()
    while not lockstep.plant.over:
        play(lockstep, 50.0, 50.0, 50.0)
    assert lockstep.plant.tick < 1000
    assert lockstep.plant.outcome(0.0).ending == FELL
    assert lockstep.plant.outcome(0.0, "stopped").ending == FELL
    assert plant().plant.outcome(0.0, "stopped").ending == "stopped"


def test_a_push_acts_for_exactly_its_ticks() -> None:
    """Ticks 3 to 5, and where two overlap they add up; recorded when it begins."""
    pushes: list[tuple[int, Command]] = [
        (3, Push(HIP, 40.0, 3)),
        (4, Push(HIP, -10.0, 1)),
        (4, Push(KNEE, 5.0, 2)),
    ]
    lockstep = plant(events=pushes)
    forces, begun = [], []
    for _ in range(9):
        record = play(lockstep)
        forces.append(tuple(lockstep.plant.body.forces_n[1:]))
        begun += [(record.tick, event) for event in happened(record, "push")]
    assert forces[:3] == [(0.0, 0.0)] * 3
    assert forces[3:7] == [(0.0, 40.0), (0.0, 30.0), (5.0, 40.0), (5.0, 0.0)]
    assert forces[7:] == [(0.0, 0.0)] * 2
    # At most one command in a tick: the second of tick 4 has its turn in tick 5.
    assert begun == [(3, [HIP, 40.0, 3]), (4, [HIP, -10.0, 1]), (5, [KNEE, 5.0, 2])]


def test_a_push_moves_the_body_from_its_tick_on() -> None:
    pushed, left = plant(events=[(3, Push(HIP, 40.0, 2))]), plant()
    for tick in range(6):
        record, other = play(pushed), play(left)
        assert (record.angles_rad == other.angles_rad) == (tick <= 3)


def test_a_fall_says_when_and_which_joints_nobody_drove() -> None:
    """S21: a joint without a board, and one whose board had not begun to drive."""
    lockstep = plant(unattended=PASSIVE)
    play(lockstep)
    lockstep.remove(KNEE, "died")
    play(lockstep)
    lockstep.remove(HIP, "died")
    play(lockstep)
    lockstep.plant.admit(HIP, 2)
    while not lockstep.plant.over:
        opened(lockstep)
        reply(lockstep, HIP, 0.0, State.SYNCING)
        finish(lockstep)
    outcome = lockstep.plant.outcome(0.0)
    assert outcome.undriven == (
        UndrivenJoint("knee", 1, "passive", has_board=False),
        UndrivenJoint("hip", 2, "passive", has_board=True),
    )
    line = fall_line(outcome._replace(tick=3840), 1e-3)
    assert line == (
        "fell at 3.84 s; knee had had no board since 0.00 s and was passive;"
        " hip had not been driven since 0.00 s and was passive"
    )


def test_a_fall_of_a_whole_robot_says_when() -> None:
    lockstep = plant()
    while not lockstep.plant.over:
        play(lockstep, 50.0, 50.0, 50.0)
    outcome = lockstep.plant.outcome(0.0)
    assert outcome.undriven == ()
    assert fall_line(outcome, 1e-3) == f"fell at {outcome.tick / 1000:.2f} s"


def test_sides_are_recorded_when_they_change() -> None:
    """A middle board that goes at the boundary of a tick, and one that dies in the middle of it."""
    lockstep = plant()
    assert happened(play(lockstep), "sides") == []
    lockstep.remove(KNEE, "unplugged")
    assert happened(play(lockstep), "sides") == [[[[ANKLE], [HIP]]]]
    assert happened(play(lockstep), "sides") == []
    lockstep.plant.admit(KNEE, 2)
    assert happened(play(lockstep), "sides") == [[[[ANKLE, KNEE, HIP]]]]
    opened(lockstep)
    lockstep.remove(KNEE, "died")
    assert happened(finish(lockstep), "sides") == []
    assert happened(play(lockstep), "sides") == [[[[ANKLE], [HIP]]]]
