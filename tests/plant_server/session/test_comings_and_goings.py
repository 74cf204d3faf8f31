"""Boards that die, go, come, and are given up: what each means for the tick that is open."""

from collections import Counter
from math import nan

import pytest

from plant_server.session.record import TickRecord
from protocol.robot.events import LinkChange
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_TICK,
    Neighbour,
    Observation,
    Reason,
    decode,
)
from tests.plant_server.plant import (
    ANKLE,
    BRAKED,
    HIP,
    KNEE,
    LIMP,
    PASSIVE,
    POSTURE_RAD,
    answer,
    finish,
    happened,
    opened,
    plant,
    play,
    reply,
)


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
