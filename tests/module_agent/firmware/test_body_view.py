"""What a board knows of the body, and what it makes of gaps (S9)."""

from math import sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.body_view import (
    FORGET_EVERY_TICKS,
    AngleAndRate,
    BodySample,
    BodyView,
    OwnAngles,
)
from module_agent.firmware.kinematics import NOTHING, CarriedMass, add_link
from protocol.robot.hardware import Link
from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame

THIGH = Link(10.0, 0.5, 0.25, 0.2)
TRUNK = Link(30.0, 0.5, 0.25, 0.6)
TICK_S = 0.001
DELAY_TICKS = 10
NO_IMU = AngleAndRate(0.0, 0.0)


def middle() -> BodyView:
    """A knee: no IMU, a board above and one below."""
    return BodyView(
        THIGH, tick_s=TICK_S, lumped_delay_ticks=DELAY_TICKS, has_imu=False, bottom=False
    )


def knee(tick: int) -> AngleAndRate:
    """A true joint angle and rate that differ in every tick."""
    return AngleAndRate(0.1 * sin(0.01 * tick), 0.02 + 1e-4 * tick)


def thigh(tick: int) -> AngleAndRate:
    """Orientation of the link between knee and hip."""
    return AngleAndRate(0.2 + 1e-3 * tick, 1.0)


def shank(tick: int) -> AngleAndRate:
    """Orientation of the link below the knee."""
    return AngleAndRate(thigh(tick).rad - knee(tick).rad, thigh(tick).rad_s - knee(tick).rad_s)


def trunk(tick: int) -> CarriedMass:
    return add_link(TRUNK, -0.1 + 2e-3 * tick, 2.0, NOTHING)


def said(sample_tick: int, lower: AngleAndRate, above: CarriedMass) -> LinkFrame:
    return LinkFrame(
        2**31, 1, sample_tick, NO_TICK, NO_EPOCH, 0, 0.0, 0, sample_tick, *lower, *above
    )


def from_above(sample_tick: int) -> LinkFrame:
    return said(sample_tick, thigh(sample_tick), trunk(sample_tick))


def from_below(sample_tick: int) -> LinkFrame:
    return said(sample_tick, shank(sample_tick), NOTHING)


def truth(tick: int) -> BodySample:
    supported = add_link(THIGH, *thigh(tick), trunk(tick))
    return BodySample(knee(tick), thigh(tick), supported)


def live(view: BodyView, ticks: range) -> None:
    """Sense and hear both neighbours, in every tick about the tick before."""
    for tick in ticks:
        view.advance(tick)
        view.sense(tick, OwnAngles(knee(tick), NO_IMU), top=False)
        view.hear_from_above(from_above(tick - 1))
        view.hear_from_below(from_below(tick - 1))


def go_on_alone(view: BodyView, ticks: range) -> None:
    for tick in ticks:
        view.advance(tick)
        view.sense(tick, OwnAngles(knee(tick), NO_IMU), top=False)


def test_a_complete_sample_is_the_truth() -> None:
    view = middle()
    live(view, range(-10, 20))
    for tick in range(-10, 19):
        sample, state = view.at(tick)
        assert state is State.RUNNING
        assert sample == truth(tick)


def test_each_step_is_taken_at_exactly_its_tick() -> None:
    """The newest sample is of tick 29: held for 5 ticks, extrapolated for 20, then reckoned."""
    view = middle()
    live(view, range(31))
    go_on_alone(view, range(31, 70))
    states = [view.at(tick)[1] for tick in range(29, 70)]
    assert states[0] is State.RUNNING
    assert states[1:6] == [State.HOLDING] * 5
    assert states[6:26] == [State.EXTRAPOLATING] * 20
    assert states[26:] == [State.RECKONING] * 15


@pytest.mark.parametrize("age", range(1, 6))
def test_holding_keeps_the_sample_but_for_the_own_joint(age: int) -> None:
    view = middle()
    live(view, range(31))
    go_on_alone(view, range(31, 70))
    held, _ = view.at(29 + age)
    assert held == truth(29)._replace(joint=knee(29 + age))


@pytest.mark.parametrize("age", range(6, 26))
def test_extrapolating_moves_the_sample_on_by_its_rates(age: int) -> None:
    view = middle()
    live(view, range(31))
    go_on_alone(view, range(31, 70))
    moved, _ = view.at(29 + age)
    old, ahead_s = truth(29), age * TICK_S
    assert moved.joint == knee(29 + age)
    assert moved.link == pytest.approx((old.link.rad + ahead_s * old.link.rad_s, old.link.rad_s))
    mass, x_m, y_m, x_m_s, y_m_s = old.supported
    there = (mass, x_m + ahead_s * x_m_s, y_m + ahead_s * y_m_s, x_m_s, y_m_s)
    assert moved.supported == pytest.approx(there)


def test_reckoning_takes_what_is_above_for_rigid_and_the_orientation_from_the_foot() -> None:
    """The body stands still from tick 29 on but for the shank: it turns, all above turns along."""
    view = middle()
    live(view, range(31))
    lower = shank(29)
    for tick in range(31, 70):
        view.advance(tick)
        view.sense(tick, OwnAngles(knee(29), NO_IMU), top=False)
        turned = AngleAndRate(lower.rad + 0.01 * (tick - 30), 10.0)
        view.hear_from_below(said(tick - 1, turned, NOTHING))
    sample, state = view.at(60)
    assert state is State.RECKONING
    rad = lower.rad + 0.31 + knee(29).rad
    rate = 10.0 + knee(29).rad_s
    assert sample.link == pytest.approx((rad, rate))
    rigid_trunk = add_link(TRUNK, -0.1 + 2e-3 * 29 + rad - thigh(29).rad, rate, NOTHING)
    assert sample.supported == pytest.approx(add_link(THIGH, rad, rate, rigid_trunk), abs=1e-12)


@pytest.mark.parametrize("gap_ticks", [1, 5, 6, 25, 26, 60])
def test_recovers_as_soon_as_a_sample_is_there(gap_ticks: int) -> None:
    view = middle()
    live(view, range(31))
    end = 31 + gap_ticks
    go_on_alone(view, range(31, end))
    assert view.at(end - 1)[1] is not State.RUNNING
    live(view, range(end, end + 3))
    assert view.at(end + 1) == (truth(end + 1), State.RUNNING)


def test_a_late_sample_fills_its_gap() -> None:
    view = middle()
    live(view, range(21))
    go_on_alone(view, range(21, 31))
    view.hear_from_above(from_above(25))
    assert view.at(25) == (truth(25), State.RUNNING)
    assert view.at(27)[0].link == thigh(25)
    view.hear_from_above(from_above(23))
    assert view.at(23) == (truth(23), State.RUNNING)
    assert view.for_below(State.RUNNING) == (25, truth(25))


def test_samples_are_joined_with_the_same_tick_only() -> None:
    """A frame about a tick that this board does not have (any more, or yet) brings nothing."""
    view = middle()
    go_on_alone(view, range(10, 20))
    for tick in (9, 20, NO_TICK, -1, 10**9):
        view.hear_from_above(from_above(tick))
        view.hear_from_below(from_below(tick))
    assert view.for_below(State.RUNNING) == (NO_TICK, None)
    assert view.for_above()[0] == NO_TICK
    assert view.at(19)[1] is State.RECKONING
    view.hear_from_above(from_above(14))
    assert view.for_below(State.RUNNING) == (14, truth(14))


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.permutations(range(20)), st.permutations(range(20)))
def test_order_of_arrival_does_not_matter(down: list[int], up: list[int]) -> None:
    in_order, shuffled = middle(), middle()
    live(in_order, range(21))
    go_on_alone(shuffled, range(21))
    for above, below in zip(down, up, strict=True):
        shuffled.hear_from_above(from_above(above))
        shuffled.hear_from_below(from_below(below))
    go_on_alone(in_order, range(21, 90))
    go_on_alone(shuffled, range(21, 90))
    for tick in range(90):
        assert shuffled.at(tick) == in_order.at(tick)
    assert shuffled.for_above() == in_order.for_above()


def test_the_top_board_needs_nobody() -> None:
    hip = BodyView(TRUNK, tick_s=TICK_S, lumped_delay_ticks=DELAY_TICKS, has_imu=True, bottom=False)
    for tick in range(50):
        hip.sense(tick, OwnAngles(knee(tick), thigh(tick)), top=True)
        sample, state = hip.at(tick)
        assert state is State.RUNNING
        assert sample == BodySample(knee(tick), thigh(tick), add_link(TRUNK, *thigh(tick), NOTHING))


def test_the_bottom_board_reckons_from_a_level_foot() -> None:
    ankle = BodyView(
        THIGH, tick_s=TICK_S, lumped_delay_ticks=DELAY_TICKS, has_imu=False, bottom=True
    )
    ankle.sense(0, OwnAngles(knee(0), NO_IMU), top=False)
    sample, state = ankle.at(0)
    assert state is State.RECKONING
    assert sample.link == knee(0)
    assert ankle.for_above() == (0, knee(0))


def test_an_own_imu_is_believed_before_what_is_heard() -> None:
    view = BodyView(
        THIGH, tick_s=TICK_S, lumped_delay_ticks=DELAY_TICKS, has_imu=True, bottom=False
    )
    view.sense(0, OwnAngles(knee(0), thigh(0)), top=False)
    view.hear_from_above(said(0, AngleAndRate(0.9, 9.0), trunk(0)))
    assert view.at(0) == (truth(0), State.RUNNING)


def _entries(view: BodyView) -> int:
    stores = [store for store in vars(view).values() if isinstance(store, dict)]
    assert stores, "a view remembers in dictionaries"
    return max(len(store) for store in stores)


@pytest.mark.parametrize("hears", [True, False], ids=["all heard", "nothing heard"])
def test_memory_is_bounded(hears: bool) -> None:
    """10,000 ticks take no more room than the first 300; what is old goes now and then."""
    view = middle()
    (live if hears else go_on_alone)(view, range(300))
    bound = DELAY_TICKS + 90 + FORGET_EVERY_TICKS
    for start in range(300, 10_000, 100):
        (live if hears else go_on_alone)(view, range(start, start + 100))
        state = view.at(start + 99 - DELAY_TICKS)[1]
        view.for_below(state)
        view.for_above()
        assert _entries(view) <= bound
