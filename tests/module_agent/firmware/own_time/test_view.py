"""What a board knows of the body when samples are late, missing, or of a slower board (S9)."""

import pytest

from module_agent.firmware.body_view import (
    FORGET_EVERY_TICKS,
    LATENESS_TICKS_MAX,
    AngleAndRate,
    BodyView,
    OwnAngles,
)
from protocol.robot.hardware import Link
from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame

DELAY, HOLD = 4, 10
LINK = Link(10.0, 0.5, 0.25, 0.2)


def view(*, has_imu: bool = True, pitch: int = 1) -> BodyView:
    return BodyView(
        LINK,
        tick_s=0.002,
        lumped_delay_ticks=DELAY,
        has_imu=has_imu,
        bottom=not has_imu,
        hold_ticks_max=HOLD,
        pitch=pitch,
    )


def turn(slot: int) -> AngleAndRate:
    return AngleAndRate(0.01 * slot, 0.1)


def live(one: BodyView, slot: int, sampled: int, *, top: bool = True) -> None:
    """A period in which the newest observation is of `sampled`."""
    one.advance(slot)
    one.sense(sampled, OwnAngles(turn(sampled), turn(sampled)), top=top)


def test_a_sample_bears_the_period_in_which_it_was_taken() -> None:
    one = view()
    for slot in range(20):
        live(one, slot, slot - slot % 3)  # Each third observation comes, and a late one.
    sample, state = one.at(9)
    assert (sample.joint, sample.link, state) == (turn(9), turn(9), State.RUNNING)


def test_between_two_samples_the_older_one_holds() -> None:
    one = view()
    live(one, 0, 0)
    live(one, 5, 5)
    sample, state = one.at(3)
    assert (sample.joint, state) == (turn(0), State.HOLDING)
    assert one.at(5)[0].joint == turn(5)


def test_one_period_more_is_no_gap() -> None:
    one = view()
    live(one, 0, 0)
    live(one, 2, 2)
    assert one.at(1)[1] is State.RUNNING
    live(one, 5, 5)
    assert one.at(4)[1] is State.HOLDING


def test_a_slower_board_above_leaves_no_gap() -> None:
    one = view(has_imu=False, pitch=4)
    frame = LinkFrame(1, 1, 0, NO_TICK, NO_EPOCH, 0, 0.0, 1, 0, 0.3, 0.0, 5.0, 0.1, 0.4, 0.0, 0.0)
    for slot in range(13):
        live(one, slot, slot, top=False)
        if slot % 4 == 0:
            one.hear_from_above(frame._replace(sample_tick=slot))
    assert {one.at(slot)[1] for slot in range(4, 13)} == {State.RUNNING}
    assert one.at(11)[0].joint == turn(11), "the own joint is as of the period that is asked for"
    assert one.at(11)[0].supported == one.at(8)[0].supported


def test_when_nothing_comes_the_newest_holds_for_a_while_and_no_longer() -> None:
    one = view()
    live(one, 0, 0)
    for slot in range(1, HOLD + DELAY + 5):
        live(one, slot, 0)
        wanted = slot - DELAY
        assert one.sampled(max(0, wanted)) == (wanted <= HOLD)
    live(one, 50, 50)
    assert one.sampled(46), "and is there again with the next one"


def test_what_was_held_gives_way_to_what_was_sampled() -> None:
    one = view()
    live(one, 0, 0)
    live(one, 10, 0)
    assert one.sampled(6)
    live(one, 11, 6)
    assert one.at(6)[0].joint == turn(6)


@pytest.mark.parametrize("leap", [1, 2, 7, 90, 10_000])
def test_memory_does_not_grow_whatever_is_left_out(leap: int) -> None:
    one = view()
    bound = DELAY + 25 + LATENESS_TICKS_MAX + FORGET_EVERY_TICKS + HOLD + 2
    for slot in range(0, 300 * leap, leap):
        live(one, slot, slot - slot % 2)
        for samples in (one._joint, one._imu, one._complete, one._lower):
            assert len(samples) <= bound
            assert all(slot - bound < kept <= slot for kept in samples)


def test_an_ancient_observation_is_no_sample() -> None:
    one = view()
    live(one, 1000, 1000)
    live(one, 1001, 3)
    assert not one.sampled(3)
