"""Work on all cores: the same results as on one, none lost in silence, nothing left behind."""

import os
import signal
import subprocess
import sys
from multiprocessing import active_children
from pathlib import Path

import pytest

from deploy.failure import FailedError
from deploy.launch.workers import work_off
from protocol.process.stopping import StoppedError
from tests.system.rig import alive, children_of, eventually

STOPPABLE = """
import sys, time
from deploy.launch.workers import work_off
from protocol.process.stopping import stop_on_signals

if __name__ == "__main__":
    stop_on_signals()
    print(work_off(time.sleep, [0.01, 60.0, 60.0], lambda _: print("one", flush=True)))
"""


def square(number: int) -> int:
    return number * number


def die(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_every_piece_is_done_once() -> None:
    told: list[int] = []
    results, complete = work_off(square, range(50), told.append)
    assert complete
    assert results == told
    assert sorted(results) == [number * number for number in range(50)]


def test_no_work_needs_no_workers() -> None:
    assert work_off(square, [], print) == ([], True)


def test_what_is_done_when_it_is_stopped_is_kept_and_no_worker_stays() -> None:
    told: list[int] = []

    def stop_after_two(result: int) -> None:
        told.append(result)
        if len(told) == 2:
            raise StoppedError

    results, complete = work_off(square, range(50), stop_after_two)
    assert not complete
    assert results == told
    assert len(told) == 2
    assert active_children() == []


def test_a_worker_that_dies_is_not_waited_for() -> None:
    with pytest.raises(FailedError, match="a worker ended with code -9"):
        work_off(die, range(10), lambda _: None)
    assert active_children() == []


def started(tmp_path: Path) -> "subprocess.Popen[str]":
    script = tmp_path / "stoppable.py"
    script.write_text(STOPPABLE)
    child = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "one\n"
    return child


def test_a_ctrl_c_that_everybody_sees_keeps_what_is_done(tmp_path: Path) -> None:
    """A terminal sends it to the workers as well; only the parent answers, without a traceback."""
    child = started(tmp_path)
    os.killpg(child.pid, signal.SIGINT)
    out, err = child.communicate(timeout=30)
    assert (out, err, child.returncode) == ("([None], False)\n", "", 0)


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    child = started(tmp_path)
    workers = children_of(child.pid)
    assert workers
    child.kill()
    child.communicate(timeout=30)
    eventually(lambda: not any(map(alive, workers)))
