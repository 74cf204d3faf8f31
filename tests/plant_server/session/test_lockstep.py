"""The barrier and what it lets through: answers are a set, and no answer can hurt the body."""

from collections import Counter
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_server.session.record import COMPLETE, FELL, TickRecord, UndrivenJoint, fall_line
from protocol.robot.events import Command, LinkChange, Push
from protocol.robot.hardware import IDEAL, MotorSheet
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_TICK,
    LinkFrame,
    LinkUse,
    Neighbour,
    Observation,
    Reason,
    TorqueFrame,
    decode,
    encode,
    seal,
)
from tests.plant_server.plant import (
    ANKLE,
    BRAKED,
    HIP,
    KNEE,
    LIMIT_NM,
    LIMP,
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


def test_s5_a_board_that_dies_after_it_has_answered_has_completed_the_tick() -> None:
    """Its torque acts, it is on the roster to the end of the tick, and then it is gone."""
    lockstep = plant()
    opened(lockstep)
    assert reply(lockstep, HIP, 20.0)
    lockstep.remove(HIP, "died")
    assert lockstep.plant.roster.present(HIP)
    record = finish(lockstep, 0.0, 0.0, 0.0)
    assert record.torques_nm == (0.0, 0.0, 20.0)
    assert record.answers[HIP] == answer(0, 20.0, board=HIP)
    assert happened(record, "gone") == []
    told = opened(lockstep)
    assert list(told) == [ANKLE, KNEE]
    assert told[KNEE].neighbours == (Neighbour(1, 0, 1), Neighbour(0, 0, 1))
    record = finish(lockstep)
    assert record.torques_nm[HIP] == 0.0
    assert record.answers[HIP] == b""
    assert happened(record, "gone") == [[HIP, "died"]]


def test_who_went_between_two_ticks_is_told_from_who_had_been_given_the_tick() -> None:
    """A replay gives the second its observation, and lets it act in vain."""
    lockstep = plant()
    play(lockstep)
    lockstep.remove(KNEE, "unplugged")
    opened(lockstep)
    lockstep.remove(HIP, "died")
    record = finish(lockstep)
    assert happened(record, "gone") == [[KNEE, "unplugged"]]
    assert happened(record, "gone_midway") == [[HIP, "died"]]


def test_s5_nor_is_it_too_early_when_the_answer_was_the_last_one() -> None:
    """Between the last answer and the end of the tick nothing is waited for any more."""
    lockstep = plant()
    opened(lockstep)
    for board in range(3):
        reply(lockstep, board, 10.0)
    assert not lockstep.waiting
    lockstep.remove(HIP, "silent")
    assert lockstep.close().torques_nm == (10.0, 10.0, 10.0)
    assert happened(play(lockstep), "gone") == [[HIP, "silent"]]


def test_s5_a_board_that_dies_before_it_has_answered_has_not_completed_the_tick() -> None:
    """Nobody waits for it, nothing acts, and its neighbours hear so in the next tick."""
    lockstep = plant()
    play(lockstep, 0.0, 0.0, 20.0)
    told = opened(lockstep)
    assert told[KNEE].neighbours[1] == Neighbour(1, 0, 1)
    reply(lockstep, ANKLE)
    reply(lockstep, KNEE)
    lockstep.remove(HIP, "died")
    assert not lockstep.waiting
    assert not reply(lockstep, HIP, 30.0)  # What was on its way is void.
    assert not lockstep.answer(HIP, answer(1, 30.0, board=HIP))
    record = lockstep.close()
    assert record.torques_nm[HIP] == 0.0
    assert record.answers[HIP] == b""
    assert happened(record, "gone_midway") == [[HIP, "died"]]
    assert happened(record, "gone") == []
    assert opened(lockstep)[KNEE].neighbours[1] == Neighbour(0, 0, 1)


@pytest.mark.parametrize("order", [(KNEE, HIP), (HIP, KNEE)])
def test_deaths_in_one_tick_are_the_same_in_any_order(order: tuple[int, int]) -> None:
    """Brakes act at the end of the tick, from the ground up: to the bit, whoever is heard first."""

    def play_deaths(boards: tuple[int, int]) -> tuple[list[float], TickRecord]:
        lockstep = plant(unattended=BRAKED)
        for _ in range(30):
            play(lockstep, 40.0, -30.0, 20.0)
        opened(lockstep)
        for board in boards:
            lockstep.remove(board, "died")
        record = finish(lockstep, 1.0, 2.0, 3.0)
        return [*lockstep.plant.body.angles_rad, *lockstep.plant.body.rates_rad_s], record

    (state, record), (other, expected) = play_deaths(order), play_deaths((KNEE, HIP))
    assert state == other
    assert sorted(record.events, key=str) == sorted(expected.events, key=str)
    assert record[:-1] == expected[:-1]


def test_a_tick_is_recorded_as_it_was_sensed_even_if_a_brake_closes_in_it() -> None:
    """S20: the state before the step is the one that the boards were told."""
    lockstep = plant(unattended=BRAKED)
    for _ in range(30):
        play(lockstep, 40.0, -30.0, 20.0)
    told = opened(lockstep)
    lockstep.remove(HIP, "died")
    again = decode(Observation, lockstep.observation(KNEE))
    assert again == told[KNEE]
    record = finish(lockstep)
    assert record.rates_rad_s[HIP] == told[HIP].readings.joint_rad_s != 0.0
    assert lockstep.plant.body.rates_rad_s[HIP] == 0.0
    ((board, lost_j),) = happened(record, "energy_lost_j")
    assert board == HIP
    assert isinstance(lost_j, float)
    assert lost_j > 0.0


def test_s17_a_braked_joint_is_constant_until_its_new_board_drives() -> None:
    """A board that is syncing is not there yet: its torque is 0 N m and the brake holds."""
    lockstep = plant(unattended=BRAKED)
    for _ in range(30):
        play(lockstep, 20.0, -10.0, 5.0)
    lockstep.remove(HIP, "unplugged")
    held = {play(lockstep).angles_rad[HIP] for _ in range(5)}
    lockstep.plant.admit(HIP, 2)
    for _ in range(4):
        opened(lockstep)
        reply(lockstep, HIP, 7.0, State.SYNCING)
        record = finish(lockstep)
        assert record.torques_nm[HIP] == 0.0
        held.add(lockstep.plant.body.angles_rad[HIP])
    assert len(held) == 1
    assert play(lockstep, 0.0, 0.0, 7.0).torques_nm[HIP] == 7.0
    assert lockstep.plant.body.angles_rad[HIP] not in held


def test_s17_a_board_that_comes_during_the_warm_up_is_no_exception() -> None:
    lockstep = plant(warm_up_ticks=4, unattended=BRAKED)
    play(lockstep)
    lockstep.remove(HIP, "died")
    play(lockstep)
    lockstep.plant.admit(HIP, 2)
    while lockstep.plant.tick < 3:
        opened(lockstep)
        reply(lockstep, HIP, 0.0, State.SYNCING)
        finish(lockstep)
    assert lockstep.plant.body.angles_rad[HIP] == POSTURE_RAD[HIP]
    assert lockstep.plant.body.angles_rad[KNEE] != POSTURE_RAD[KNEE]
    play(lockstep)
    assert lockstep.plant.body.angles_rad[HIP] != POSTURE_RAD[HIP]


def test_s17_limp_and_passive_joints_move_without_a_motor() -> None:
    """Limp: 0 N m. Passive: the sensor shows the spring and the damper."""
    for how, shows in ((LIMP, False), (PASSIVE, True)):
        lockstep = plant(unattended=how)
        lockstep.remove(KNEE, "unplugged")
        record = play(lockstep, 0.0, 0.0, 0.0)
        for _ in range(50):
            record = play(lockstep)
            assert record.torques_nm[KNEE] == 0.0
        assert record.angles_rad[KNEE] != POSTURE_RAD[KNEE]
        assert (lockstep.plant.body.torques_nm[KNEE] != 0.0) == shows


def test_a_new_incarnation_does_not_inherit_the_torque_of_the_old_one() -> None:
    """What bridges a gap is the last valid torque of this board, of which there is none."""
    lockstep = plant()
    play(lockstep, 0.0, 0.0, 20.0)
    lockstep.remove(HIP, "died")
    lockstep.plant.admit(HIP, 2)
    assert play(lockstep, 0.0, 0.0, nan).torques_nm[HIP] == 0.0


def test_s6_an_excused_board_goes_on_without_the_frame_and_only_in_this_tick() -> None:
    """The rest of what it was told stays as it was, with the command that it may have lost."""
    lockstep = plant(events=[(1, LinkChange(((HIP, KNEE),), {"loss": 0.5}))])
    play(lockstep)
    told = opened(lockstep)
    assert told[KNEE].command
    reply(lockstep, HIP)
    excused = decode(Observation, lockstep.excuse(HIP, KNEE))
    below, above = told[KNEE].neighbours
    not_waited_for = above._replace(completed_tick=-1, waits=0)
    assert excused == told[KNEE]._replace(neighbours=(below, not_waited_for))
    assert decode(Observation, lockstep.observation(KNEE)) == excused
    assert decode(Observation, lockstep.excuse(HIP, KNEE)) == excused  # Once is enough.
    assert happened(finish(lockstep), "excused") == [[HIP, KNEE]]
    assert opened(lockstep)[KNEE].neighbours == (Neighbour(1, 1, 1), Neighbour(1, 1, 1))


def test_s6_whoever_is_no_neighbour_cannot_be_waited_for() -> None:
    """The plant hears of it from a board, which may say anything."""
    lockstep = plant()
    told = opened(lockstep)
    for sender in (HIP, ANKLE, 99, -1):
        assert decode(Observation, lockstep.excuse(sender, ANKLE)) == told[ANKLE]
    assert happened(finish(lockstep), "excused") == []


def test_a_board_that_was_given_up_learns_so() -> None:
    """The observation of the tick, for incarnation 0: nobody."""
    lockstep = plant()
    told = opened(lockstep)
    lockstep.remove(HIP, "silent")
    lost = decode(Observation, lockstep.observation(HIP))
    assert lost == told[HIP]._replace(incarnation=0)


def test_s16_what_was_said_before_a_board_was_there_was_not_said_to_it() -> None:
    """Its neighbours may say it once more when they find it; it is void, and not waited for."""
    lockstep = plant()
    lockstep.remove(HIP, "unplugged")
    play(lockstep)
    lockstep.plant.admit(HIP, 2)
    told = opened(lockstep)
    assert told[HIP].neighbours == (Neighbour(1, NO_TICK, 1),)
    assert told[KNEE].neighbours == (Neighbour(1, 0, 1), Neighbour(2, NO_TICK, 1))
    finish(lockstep)
    told = opened(lockstep)
    assert told[HIP].neighbours == (Neighbour(1, 1, 1),)
    assert told[KNEE].neighbours[1] == Neighbour(2, 1, 1)


@pytest.mark.parametrize("stale", [0, 1, 3])
def test_other_incarnations_are_fenced(stale: int) -> None:
    lockstep = plant()
    lockstep.remove(HIP, "died")
    lockstep.plant.admit(HIP, 2)
    opened(lockstep)
    assert not lockstep.answer(HIP, answer(0, 9.0, board=HIP, incarnation=stale))
    assert lockstep.plant.refused == Counter({Reason.INCARNATION: 1})
    assert lockstep.answer(HIP, answer(0, 9.0, board=HIP, incarnation=2))


def test_removing_twice_or_nobody_is_harmless() -> None:
    lockstep = plant(here=(ANKLE, KNEE))
    lockstep.remove(HIP, "died")
    opened(lockstep)
    lockstep.remove(KNEE, "died")
    lockstep.remove(KNEE, "silent")
    assert happened(finish(lockstep), "gone_midway") == [[KNEE, "died"]]


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
