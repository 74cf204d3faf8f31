"""Pace: ticks keep to a wall clock that the test brings."""

from random import Random

import pytest

from plant_server.session.pace import SLIP_S, Pace

TICK_S = 0.001


class Wall:
    """A wall clock, and a host that oversleeps and is busy as the test says."""

    def __init__(self) -> None:
        self.now_s = 1234.5

    def play(
        self, pace: Pace, tick: int, *, oversleeps_s: float = 0.0, busy_s: float = 0.0
    ) -> float:
        """Wait for a tick and live through it; the time at which it was opened."""
        while (wait_s := pace.wait_s(tick, self.now_s)) > 0.0:
            self.now_s += wait_s + oversleeps_s
        opened_s = self.now_s
        self.now_s += busy_s
        return opened_s


@pytest.mark.parametrize("pace", [1.0, 0.25, 3.0])
def test_lateness_never_adds_up(pace: float) -> None:
    """However much every sleep overshoots, the last tick is opened at its own time."""
    wall, random, kept = Wall(), Random(1), Pace(tick_s=TICK_S, pace=pace)
    started_s = wall.play(kept, -10)
    for tick in range(-9, 100_000):
        opened_s = wall.play(kept, tick, oversleeps_s=random.uniform(0.0, 2e-4), busy_s=1e-4)
    assert 0.0 <= opened_s - started_s - (tick + 10) * TICK_S / pace < 2.1e-4
    assert kept.slipped_s == 0.0


def test_who_is_a_little_late_catches_up() -> None:
    wall, pace = Wall(), Pace(tick_s=TICK_S)
    started_s = wall.play(pace, 0, busy_s=0.05)
    late = [wall.play(pace, tick) for tick in range(1, 51)]
    assert late[:49] == [started_s + 0.05] * 49, "no wait before it has caught up"
    assert wall.play(pace, 60) == pytest.approx(started_s + 0.06, abs=1e-9)
    assert pace.slipped_s == 0.0
    assert pace.behind_s_max == pytest.approx(0.049)


def test_who_is_far_too_late_gives_the_time_up_and_says_how_much() -> None:
    wall, pace = Wall(), Pace(tick_s=TICK_S)
    wall.play(pace, 0, busy_s=30.0)
    resumed_s = wall.play(pace, 1)
    assert wall.play(pace, 2) == pytest.approx(resumed_s + TICK_S), "no rush"
    assert pace.slipped_s == pace.behind_s_max == pytest.approx(30.0 - TICK_S)


def test_a_host_at_half_the_speed_gives_up_half_of_the_time() -> None:
    wall, pace = Wall(), Pace(tick_s=TICK_S)
    for tick in range(10_000):
        wall.play(pace, tick, busy_s=2 * TICK_S)
    assert pace.slipped_s == pytest.approx(10.0, abs=SLIP_S + TICK_S)
