"""Stops: one exception for any number of signals, and never in the middle of what must be whole."""

import os
import signal
from collections.abc import Iterator

import pytest

from protocol.process import StoppedError, stop_on_signals, undisturbed


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    stop_on_signals()
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_stops_and_later_ones_do_nothing(number: signal.Signals) -> None:
    with pytest.raises(StoppedError):
        signal.raise_signal(number)
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGTERM)


def test_a_stop_waits_for_what_must_not_be_left_half_done() -> None:
    done = []
    with pytest.raises(StoppedError), undisturbed:  # noqa: PT012 - what comes after is the point
        os.kill(os.getpid(), signal.SIGINT)
        done.append("whole")
    assert done == ["whole"]
    with undisturbed:
        done.append("and once is enough")


def test_without_a_stop_nothing_happens_and_the_next_one_is_at_once() -> None:
    with undisturbed:
        pass
    with pytest.raises(StoppedError):
        signal.raise_signal(signal.SIGTERM)


def test_what_fails_within_is_told_rather_than_the_stop() -> None:
    with pytest.raises(ZeroDivisionError), undisturbed:  # noqa: PT012 - as above
        signal.raise_signal(signal.SIGINT)
        _ = 1 / 0
