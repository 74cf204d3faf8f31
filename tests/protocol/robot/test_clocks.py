"""Clocks that are not the plant's: ages of readings, late ticks, start-up."""

from itertools import pairwise

import pytest

from protocol.robot.clocks import Clock
from protocol.robot.hardware import STEADY, ClockSheet

TICK_S = 1e-3
SEEDS = range(20)


def clock(seed: int = 1, board: int = 0, **sheet: object) -> Clock:
    return Clock(ClockSheet(**sheet), seed=seed, board=board, tick_s=TICK_S)  # type: ignore[arg-type]


def late(one: Clock, ticks: int) -> list[int]:
    return [tick for tick in range(-50, ticks) if one.late(tick)]


def test_a_steady_clock_is_the_plants() -> None:
    steady = clock()
    assert ClockSheet() == STEADY
    assert late(steady, 5000) == []
    assert {steady.age_ticks(tick) for tick in range(-10, 1000)} == {0.0}
    assert steady.start_up_ticks(7) == 0


@pytest.mark.parametrize("ppm", [-500.0, -1000.0, -10_000.0])
def test_a_slow_clock_loses_one_tick_in_so_many(ppm: float) -> None:
    """Evenly, from a phase that the seed decides; never in the warm-up."""
    every = round(-1e6 / ppm)
    firsts = set()
    for seed in SEEDS:
        lost = late(clock(seed, skew_ppm=ppm), 10 * every)
        assert all(abs(b - a - every) <= 1 for a, b in pairwise(lost))
        assert len(lost) in {9, 10, 11}
        assert lost[0] >= 0
        firsts.add(lost[0])
    assert len(firsts) > len(SEEDS) // 2


def test_a_fast_clock_is_never_late() -> None:
    for seed in SEEDS:
        assert late(clock(seed, skew_ppm=10_000.0), 2000) == []


@pytest.mark.parametrize("ppm", [-5000.0, 5000.0])
def test_readings_drift_through_a_whole_tick(ppm: float) -> None:
    ages = [clock(skew_ppm=ppm).age_ticks(tick) for tick in range(1000)]
    assert all(0.0 <= age < 1.0 for age in ages)
    steps = [b - a for a, b in pairwise(ages)]
    slow = [step for step in steps if abs(step) < 0.5]
    assert all(abs(step - ppm * 1e-6) < 1e-9 for step in slow)
    assert len(steps) - len(slow) in {4, 5, 6}, "and then jump back"
    assert max(ages) - min(ages) > 0.99


def test_jitter_is_even_and_below_what_it_is_given() -> None:
    ages = [clock(jitter_s=0.3 * TICK_S).age_ticks(tick) for tick in range(4000)]
    assert all(0.0 <= age < 0.3 for age in ages)
    assert abs(sum(ages) / len(ages) - 0.15) < 0.005
    assert len(set(ages)) == len(ages)


def test_overruns_are_where_they_are_put() -> None:
    assert late(clock(overrun_ticks=(3, 100)), 200) == [3, 100]


def test_start_up_takes_its_time_and_up_to_its_jitter_more() -> None:
    board = clock(start_up_ticks=100, start_up_jitter_ticks=10)
    taken = {board.start_up_ticks(tick) for tick in range(1000)}
    assert taken == set(range(100, 111))


def test_what_a_clock_does_follows_from_seed_and_board() -> None:
    def told(seed: int, board: int) -> list[float]:
        one = clock(seed, board, skew_ppm=-700.0, jitter_s=1e-4)
        return [one.age_ticks(tick) for tick in range(50)]

    assert told(1, 0) == told(1, 0)
    assert told(1, 0) != told(2, 0)
    assert told(1, 0) != told(1, 1)
