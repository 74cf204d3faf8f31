"""The watchdog says where the thread that it watches is stuck, and only then."""

import threading
from queue import Empty, SimpleQueue

import pytest

from module_agent.process.watchdog import LOOKS, Watchdog

PATIENCE_S = 0.08
LONG_S = 30.0
"""For what must happen, however slow the machine is."""


def test_where_a_loop_hangs_is_told_once_each_time_it_does() -> None:
    told: SimpleQueue[str] = SimpleQueue()
    rounds = 0

    def hang() -> None:
        where = told.get(timeout=LONG_S)
        assert " in hang < test_watchdog.py:" in where
        with pytest.raises(Empty):
            told.get(timeout=3 * PATIENCE_S)

    with Watchdog(lambda: rounds, told.put, patience_s=PATIENCE_S):
        for _ in range(2):
            rounds += 1
            hang()


def test_a_loop_that_goes_round_is_left_alone() -> None:
    """However slowly: a round between any two of its looks is enough."""
    looks, told = 0, list[str]()
    enough = threading.Event()

    def rounds() -> int:
        nonlocal looks
        looks += 1
        if looks > 5 * LOOKS:
            enough.set()
        return looks // (LOOKS - 1)

    with Watchdog(rounds, told.append, patience_s=PATIENCE_S):
        assert enough.wait(LONG_S)
    assert told == []


def test_it_ends_with_what_it_watches() -> None:
    before = threading.active_count()
    with Watchdog(lambda: 0, print, patience_s=LONG_S):
        assert threading.active_count() == before + 1
    assert threading.active_count() == before
