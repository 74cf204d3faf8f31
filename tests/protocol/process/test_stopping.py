"""Stops: one exception for any number of signals, and never in the middle of what must be whole."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from protocol.process.stopping import StoppedError, stop_on_signals, undisturbed

STUCK_ONCE = """
import sys, threading
from pathlib import Path
from protocol.process.stopping import restarted_when_stuck

first = not Path(sys.argv[1]).exists()
Path(sys.argv[1]).touch()
with restarted_when_stuck(0.2 if first else 60.0):
    if first:
        threading.Lock().acquire() and threading.Event().wait()
print("joined", *sys.argv[2:])
"""


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


def test_a_process_that_is_stuck_at_its_start_begins_again(tmp_path: Path) -> None:
    """With the same arguments, as the same process."""
    program = tmp_path / "program.py"
    program.write_text(STUCK_ONCE)
    command = [sys.executable, str(program), str(tmp_path / "begun"), "an", "argument"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "joined an argument\n"
    assert "starting again" in done.stderr
