"""Storms: what is one, what is none, and how often it is told."""

from protocol.wire.frames import Reason
from protocol.wire.storms import LOOK_EVERY_S, PER_S_MAX, PER_TICK_MAX, TELL_EVERY_S, Storms

KNEE = "frames of knee"


def after(seconds: float, ticks: int, **refused: int) -> Storms:
    """Two looks, so much later; what was refused in between, by reason."""
    storms = Storms()
    assert storms.look(100.0, 5000, {KNEE: {}}) == []
    counts = {Reason(name): count for name, count in refused.items()}
    storms.look(100.0 + seconds, 5000 + ticks, {KNEE: counts})
    return storms


def test_a_storm_is_named_by_origin_and_main_reason() -> None:
    (storm,) = after(2.0, 100, corrupt=9000, size=200, tick=1000).raging
    assert storm == (KNEE, 5100.0, Reason.CORRUPT)
    assert str(storm) == ("a storm: 5,100 frames of knee a second are refused, mostly as corrupt")


def test_what_comes_at_the_pace_of_the_ticks_is_a_bad_link_and_no_storm() -> None:
    """A link brings one frame a tick, and a twin of 8,000 ticks a second may damage each."""
    ticks = 8000
    assert after(1.0, ticks, corrupt=ticks).raging == []
    assert after(1.0, ticks, corrupt=int(PER_TICK_MAX * ticks)).raging == []
    assert after(1.0, ticks, corrupt=int(PER_TICK_MAX * ticks) + 1).raging


def test_a_clock_that_stands_still_makes_no_storm_of_a_few() -> None:
    """Slow ticks, as of a plant in a debugger: the rate counts, not the share."""
    assert after(1.0, 0, tick=int(PER_S_MAX)).raging == []
    assert after(1.0, 0, tick=int(PER_S_MAX) + 1).raging
    assert after(60.0, 1, tick=int(PER_S_MAX) * 60).raging == []


def test_what_was_refused_before_the_first_look_is_not_judged() -> None:
    storms = Storms()
    assert storms.look(7.0, 0, {KNEE: {Reason.SIZE: 10**9}}) == []
    assert storms.raging == []


def test_a_storm_is_told_once_in_a_while_but_rages_on() -> None:
    storms, told = Storms(), []
    for second in range(25):
        now_s = 10.0 + second
        assert now_s >= storms.due_s
        told += [now_s] * len(storms.look(now_s, second, {KNEE: {Reason.RANGE: 5000 * second}}))
        assert storms.due_s == now_s + LOOK_EVERY_S
        assert bool(storms.raging) == (second > 0)
    assert told == [11.0, 11.0 + TELL_EVERY_S, 11.0 + 2 * TELL_EVERY_S]
    assert storms.look(40.0, 25, {KNEE: {Reason.RANGE: 5000 * 24}}) == []
    assert storms.raging == [], "it is over"


def test_origins_are_told_apart() -> None:
    storms = Storms()
    storms.look(0.0, 0, {KNEE: {}, "observations": {}})
    refused = {KNEE: {Reason.SIZE: 10}, "observations": {Reason.RUN: 5000}}
    assert [storm.origin for storm in storms.look(1.0, 0, refused)] == ["observations"]


def test_a_board_that_begins_anew_counts_from_nothing() -> None:
    storms = Storms()
    storms.look(0.0, 0, {KNEE: {Reason.SIZE: 10**6}})
    assert storms.look(1.0, 0, {KNEE: {Reason.SIZE: 3}}) == []
