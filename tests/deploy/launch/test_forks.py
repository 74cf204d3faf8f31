"""Work divided among forks: the same as done alone, whoever is killed meanwhile."""

import json
import subprocess
import sys

import pytest

DIVIDED = """
import json, os, signal, sys, time
from deploy.launch.forks import divided

def work(number):
    if number in {killed} and os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return [number, os.getpid()]

parent = os.getpid()
print(json.dumps([parent, divided(work, 12, {processes})]))
"""


def play(processes: int, killed: tuple[int, ...] = ()) -> tuple[int, list[list[int]]]:
    """In a process with one thread, which this is not: who it was, and who did which piece."""
    script = DIVIDED.format(processes=processes, killed=killed)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=30
    )
    parent, found = json.loads(done.stdout)
    return parent, found


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_every_piece_is_done_once_and_stands_in_its_place(processes: int) -> None:
    parent, found = play(processes)
    assert [number for number, _ in found] == list(range(12))
    assert parent in {who for _, who in found}
    assert len({who for _, who in found}) == processes


def test_what_a_killed_fork_had_done_is_done_here() -> None:
    parent, found = play(2, tuple(range(4, 12)))
    assert [number for number, _ in found] == list(range(12))
    assert {who for _, who in found} == {parent}
