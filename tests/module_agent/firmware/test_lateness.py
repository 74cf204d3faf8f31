"""Boards whose loop does not end within a tick: what they say, and what others make of it."""

import pytest

from protocol.robot.hardware import ClockSheet
from protocol.robot.states import State
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    PROPORTIONAL,
    ROUNDS,
    Robot,
    board,
    link,
    torque,
)

LATE = 60
TICKS = 3 * PERIOD_TICKS


def robot(*late: int) -> Robot:
    """Three boards, the knee of which is late in these ticks."""
    made = Robot(gains=PROPORTIONAL)
    made.boards[1] = board(1, PROPORTIONAL, clock=ClockSheet(overrun_ticks=late))
    return made


def test_a_board_that_is_never_late_is_not_slowed_down_by_it() -> None:
    assert board(1).lateness is None
    assert board(1, clock=ClockSheet(overrun_ticks=(3,))).lateness is not None


def test_a_late_board_says_what_it_said_before_with_the_number_of_the_tick() -> None:
    acts = robot(LATE).run(TICKS)
    now, before = acts[LATE][1], acts[LATE - 1][1]
    assert torque(now)[3:11] == torque(before)[3:11]
    assert torque(now).tick == LATE
    for place in (0, 1):
        assert link(now, place).tick == LATE
        assert link(now, place)[4:] == link(before, place)[4:]
        assert link(now, place).heard_tick == LATE - 1, "what it has heard is true"
    punctual = robot().run(TICKS)
    assert torque(punctual[LATE][1]).torque_nm != torque(now).torque_nm


def test_it_has_lived_through_the_tick_all_the_same() -> None:
    """The tick after, it says what it would have said without."""
    late, punctual = robot(LATE).run(TICKS), robot().run(TICKS)
    for tick in range(LATE + 1, TICKS):
        assert torque(late[tick][1]).torque_nm == torque(punctual[tick][1]).torque_nm
        assert torque(late[tick][1]).enabled == torque(punctual[tick][1]).enabled
        assert link(late[tick][1])[4:] == link(punctual[tick][1])[4:]


def test_whoever_needs_what_it_did_not_pass_on_holds_the_sample_before() -> None:
    """In that tick it would have told the ankle the sample that the hip had said before."""
    acts = robot(LATE).run(TICKS)
    held = [tick for tick in range(TICKS) if torque(acts[tick][0]).state == State.HOLDING]
    assert held == [LATE - 1 + DELAY_TICKS]
    assert all(torque(acts[tick][2]).state == State.RUNNING for tick in range(TICKS))


@pytest.mark.parametrize("late", [PERIOD_TICKS, PERIOD_TICKS + 1])
def test_late_in_an_election_it_is_a_round_behind_and_the_next_one_is_as_ever(late: int) -> None:
    acts = robot(late).run(TICKS)
    told, before = link(acts[late][1]), link(acts[late - 1][1])
    assert (told.epoch, told.round) == (before.epoch, before.round)
    assert sum(torque(act).enabled for act in acts[PERIOD_TICKS + ROUNDS]) >= 1
    assert sum(torque(act).enabled for act in acts[2 * PERIOD_TICKS + ROUNDS]) == 1


def test_a_row_of_late_ticks_repeats_the_last_punctual_one() -> None:
    acts = robot(LATE, LATE + 1, LATE + 2).run(TICKS)
    said = {torque(acts[LATE + n][1]).torque_nm for n in (-1, 0, 1, 2)}
    assert len(said) == 1
    assert torque(acts[LATE + 3][1]).torque_nm not in said


def test_late_in_the_tick_in_which_it_would_begin_it_begins_a_tick_later() -> None:
    acts = robot(0).run(20)
    assert torque(acts[0][1]).state == State.SYNCING
    assert torque(acts[0][1]).torque_nm == 0.0
    assert torque(acts[1][1]).state == State.RUNNING


def test_a_slow_clock_makes_a_board_late_now_and_then() -> None:
    made = Robot(gains=PROPORTIONAL)
    made.boards[1] = board(1, PROPORTIONAL, clock=ClockSheet(skew_ppm=-10_000.0))
    acts = made.run(1000)
    ticks = range(1, 1000)
    repeated = [t for t in ticks if link(acts[t][1])[10:] == link(acts[t - 1][1])[10:]]
    assert len(repeated) in {9, 10, 11}
