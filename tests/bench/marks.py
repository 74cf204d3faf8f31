"""Where the time of a tick goes: along the board that answers last, from one tick to the next.

Plant and boards note when they are where; the clock is one for all processes of a machine. A tick
is over when the last answer is in, so what counts is the path of that one board: the plant puts its
observation, which is on its way, waits for the neighbours' frames, is thought about, is answered,
and the answer is on its way back.
"""

import json
import statistics
import time
from itertools import pairwise
from typing import Any
from unittest.mock import patch

import module_agent.process.network
import plant_server.process.network
from module_agent.firmware.board import Board
from plant_server.session.lockstep import Lockstep
from tests.bench.job import PLANT, Place
from tests.bench.registry import Figures

STEPS = ("open_us", "there_us", "neighbours_us", "think_us", "say_us", "back_us", "close_us")
Mark = tuple[int, int]
"""When, in ns, and about which board."""


class Marks:
    """Moments of one process, by name, in the order in which they came."""

    def __init__(self, role: int) -> None:
        self.found: dict[str, list[Mark]] = {}
        if role == PLANT:
            self._watch(Lockstep, "begin", before="opens")
            self._watch(
                plant_server.process.network.PlantNetwork, "observe", after="put", which=True
            )
            self._watch(Lockstep, "answer", before="came", which=True)
            self._watch(Lockstep, "close", after="closed")
        else:
            self._watch(Board, "read", before="seen")
            self._watch(Board, "tick", before="begun", after="thought")
            self._watch(module_agent.process.network.BoardNetwork, "say", after="said")

    def write(self, place: Place, role: int) -> None:
        """Leave them to `path_of_a_tick`."""
        (place.folder / f"marks-{role}.json").write_text(json.dumps(self.found))

    def _watch(
        self, owner: Any, name: str, *, before: str = "", after: str = "", which: bool = False
    ) -> None:
        """Note when a method is called, and when it is done."""
        function, clock = getattr(owner, name), time.perf_counter_ns
        begun, done = self.found.setdefault(before, []), self.found.setdefault(after, [])

        def watched(itself: Any, *arguments: Any) -> Any:
            board = arguments[0] if which else 0
            begun.append((clock(), board))
            try:
                return function(itself, *arguments)
            finally:
                done.append((clock(), board))

        patch.object(owner, name, watched).start()


def path_of_a_tick(place: Place) -> Figures:
    """Mean time of each step of the path, over the ticks that count."""
    plant, *boards = (
        json.loads((place.folder / f"marks-{role}.json").read_bytes())
        for role in range(place.boards + 1)
    )
    return path(plant, boards, place.ticks)


def path(plant: dict[str, list[Mark]], boards: list[dict[str, list[Mark]]], ticks: int) -> Figures:
    """The same, from the marks: the last `ticks` of them, one a tick, at the plant one a board."""
    steps: dict[str, list[float]] = {name: [] for name in STEPS}
    count = len(boards)
    for back in range(1, ticks + 1):  # From the end, where every run ends alike.
        opens, closed = plant["opens"][-back][0], plant["closed"][-back][0]
        came, last = max(_of_tick(plant["came"], back, count))
        put = next(at for at, board in _of_tick(plant["put"], back, count) if board == last)
        own = {name: marks[-back][0] for name, marks in boards[last].items() if name}
        said = min(own["said"], came)  # What was put may be there before putting it is done.
        at = [opens, put, own["seen"], own["begun"], own["thought"], said, came, closed]
        for name, (start, end) in zip(STEPS, pairwise(at), strict=True):
            steps[name].append((end - start) / 1e3)
    means = {name: statistics.fmean(taken) for name, taken in steps.items()}
    return {"tick_us": sum(means.values()), **means}


def _of_tick(marks: list[Mark], back: int, count: int) -> list[Mark]:
    end = len(marks) - (back - 1) * count
    return marks[end - count : end]
