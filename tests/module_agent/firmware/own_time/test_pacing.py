"""Pacing: deadlines without drift, what becomes of missed ones, and slots over drifting clocks."""

from itertools import pairwise
from random import Random

import pytest

from module_agent.firmware.own_time.pacing import (
    CATCH_UP_MAX,
    Deadlines,
    DuePeriods,
    LoopTurn,
    PeriodicLoop,
    Slots,
)

TICK_NS = 1_000_000
PERIOD_NS = 2_000_000
START_NS = 7_000_000_123


def test_a_million_jittery_wake_ups_do_not_drift() -> None:
    random, deadlines = Random(1), Deadlines(start_ns=START_NS, period_ns=PERIOD_NS)
    periods = 0
    for _ in range(1_000_000):
        now_ns = deadlines.next_ns + random.randrange(1_500_000)
        due = deadlines.wake(now_ns)
        assert due is not None
        periods += due.periods
    assert periods == 1_000_000
    assert deadlines.next_ns == START_NS + 1_000_000 * PERIOD_NS


def test_nothing_is_due_early() -> None:
    deadlines = Deadlines(start_ns=START_NS, period_ns=PERIOD_NS)
    assert deadlines.wake(START_NS - 1) is None
    assert deadlines.wake(START_NS) == DuePeriods(1, 0)
    assert deadlines.wake(START_NS + PERIOD_NS - 1) is None
    assert deadlines.wake(START_NS + PERIOD_NS + 5) == DuePeriods(1, 5)


def test_who_oversleeps_is_told_how_many_periods_and_by_how_much() -> None:
    deadlines = Deadlines(start_ns=START_NS, period_ns=PERIOD_NS)
    assert deadlines.wake(START_NS + 3 * PERIOD_NS + 7) == DuePeriods(4, 3 * PERIOD_NS + 7)
    assert deadlines.next_ns == START_NS + 4 * PERIOD_NS, "the grid stays where it is"


def loop(*, catches_up: bool = False, phase: float = 0.25) -> PeriodicLoop:
    made = PeriodicLoop(tick_ns=TICK_NS, ticks_per_period=2, phase=phase, catches_up=catches_up)
    made.observed(0, START_NS)
    return made


def wake(made: PeriodicLoop, late_ns: int = 0) -> LoopTurn:
    assert made.next_ns is not None
    turn = made.wake(made.next_ns + late_ns)
    assert turn is not None
    return turn


def test_the_first_observation_starts_the_loop_at_its_phase() -> None:
    made = PeriodicLoop(tick_ns=TICK_NS, ticks_per_period=2, phase=0.75, catches_up=False)
    assert made.next_ns is None
    assert made.wake(START_NS) is None
    made.observed(-9, START_NS)
    assert made.next_ns == START_NS - TICK_NS + 1_500_000, "tick -9 is the second one of slot -5"
    assert wake(made) == LoopTurn((-5,), 0, 0, 1_500_000)
    assert wake(made, 100).slots == (-4,)


def test_what_was_missed_is_skipped() -> None:
    made = loop()
    wake(made)
    assert wake(made, 3 * PERIOD_NS + 1) == LoopTurn((4,), 3, 3 * PERIOD_NS + 1, 500_001)
    assert wake(made) == LoopTurn((5,), 0, 0, 500_000), "back on the grid at once"


def test_what_was_missed_is_made_up_for() -> None:
    made = loop(catches_up=True)
    wake(made)
    assert wake(made, 3 * PERIOD_NS + 1) == LoopTurn((1, 2, 3, 4), 0, 3 * PERIOD_NS + 1, 500_001)
    assert wake(made) == LoopTurn((5,), 0, 0, 500_000)


def test_no_more_is_made_up_for_than_is_of_use() -> None:
    made = loop(catches_up=True)
    wake(made)
    turn = wake(made, 1000 * PERIOD_NS)
    assert turn.slots == tuple(range(1002 - CATCH_UP_MAX, 1002))
    assert turn.skipped == 1001 - CATCH_UP_MAX


@pytest.mark.parametrize("catches_up", [False, True])
def test_every_period_is_played_skipped_or_waited_for(catches_up: bool) -> None:
    """Whatever the host does: no period is lost from the account, and slots only go on."""
    random, made = Random(3), loop(catches_up=catches_up)
    slots: list[int] = []
    skipped, woken_ns = 0, START_NS
    for _ in range(20_000):
        late_ns = round(random.paretovariate(1.2) * 20_000)
        assert made.next_ns is not None
        woken_ns = max(made.next_ns, woken_ns) + late_ns
        turn = made.wake(woken_ns)
        assert turn is not None
        assert turn.slots, "without drift there is nothing to wait for"
        slots += turn.slots
        skipped += turn.skipped
        tick = int((woken_ns - START_NS) // TICK_NS)
        made.observed(tick, START_NS + tick * TICK_NS)
    assert all(b > a for a, b in pairwise(slots))
    assert made.next_ns == START_NS + 500_000 + (len(slots) + skipped) * PERIOD_NS
    assert slots[-1] + 1 == len(slots) + skipped


@pytest.mark.parametrize("ppm", [500, -500, 0])
def test_a_drifting_clock_slips_a_slot_now_and_then(ppm: int) -> None:
    """60 s at 500 ppm are 30 ms, or 15 slots of 2 ms: one too many or too few each, no more."""
    made, played, idle = loop(phase=0.5), [], 0
    for n in range(30_000):
        own_ns = START_NS + 1_000_000 + n * PERIOD_NS
        plant_ns = round((own_ns - START_NS) / (1 + ppm * 1e-6))
        tick = plant_ns // TICK_NS
        made.observed(tick, START_NS + round(tick * TICK_NS * (1 + ppm * 1e-6)))
        turn = made.wake(own_ns)
        assert turn is not None
        assert turn.skipped == 0, "no deadline was missed"
        idle += not turn.slots
        for slot in turn.slots:
            assert -0.6 < plant_ns / PERIOD_NS - slot < 1.6
            played.append(slot)
    gaps = sum(b - a - 1 for a, b in pairwise(played))
    assert (idle > 0, gaps > 0) == (ppm > 0, ppm < 0)
    assert idle + gaps in ({14, 15} if ppm else {0})


def test_slots_follow_a_plant_that_stops_and_one_that_has_gone_on() -> None:
    slots = Slots()
    assert slots.after(1, 10.3) == 10
    assert slots.after(1, 11.3) == 11
    assert slots.after(1, 11.4) is None, "the plant has not come further"
    assert slots.after(1, 12.3) == 12
    assert slots.after(1, 40.3) == 40, "it has gone on meanwhile"
    assert slots.after(3, 43.2) == 43
