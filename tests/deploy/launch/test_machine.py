"""The machine: placing gives every process one core, in turn, but only where they have to share."""

import os
import subprocess
from collections.abc import Iterator

import pytest

from deploy.launch.machine import place

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")


@pytest.fixture
def sleeper() -> Iterator[int]:
    with subprocess.Popen(["sleep", "100"]) as process:
        yield process.pid
        process.kill()


def test_more_processes_than_cores_get_theirs_in_turn(sleeper: int) -> None:
    cores = sorted(os.sched_getaffinity(0))
    for role in range(2 * len(cores)):
        place(sleeper, role, len(cores) + 1)
        assert os.sched_getaffinity(sleeper) == {cores[role % len(cores)]}


def test_with_a_core_for_each_they_run_wherever_there_is_room(sleeper: int) -> None:
    everywhere = os.sched_getaffinity(0)
    place(sleeper, 0, len(everywhere))
    assert os.sched_getaffinity(sleeper) == everywhere


def test_what_is_confined_to_one_core_stays_so(sleeper: int) -> None:
    """Somebody has said so (`taskset`): there is nothing to share out."""
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(before)})
        place(sleeper, 1, 4)
    finally:
        os.sched_setaffinity(0, before)
    assert os.sched_getaffinity(sleeper) == before


def test_a_process_that_has_ended_is_nobodys_trouble(sleeper: int) -> None:
    os.kill(sleeper, 9)
    os.waitpid(sleeper, 0)
    everywhere = os.sched_getaffinity(0)
    place(sleeper, 0, 1000)
    assert os.sched_getaffinity(0) == everywhere
