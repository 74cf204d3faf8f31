"""When it all happened: wall times of plant and boards, as arrays over the ticks.

Rule: a time is monotonic, in nanoseconds, on the clock of the process that took it; 0: not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from protocol.wire.timing import TickTiming, Timing

Integers = NDArray[np.int64]
TWIN = "twin"
PLANT = "plant"
KB_PER_MB = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantTimes:
    """What the plant's clock said, in T ticks with N boards."""

    opened_ns: Integers
    """(T,)."""
    answered_ns: Integers
    """(T, N)."""
    closed_ns: Integers
    """(T,)."""

    @classmethod
    def unknown(cls, ticks: int, boards: int) -> Self:
        """Of so many ticks, to be filled in."""
        return cls(
            opened_ns=np.zeros(ticks, np.int64),
            answered_ns=np.zeros((ticks, boards), np.int64),
            closed_ns=np.zeros(ticks, np.int64),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardTimes:
    """What each board's own clock said, in T ticks with N boards."""

    taken_up_ns: Integers
    """(T, N)."""
    decided_ns: Integers
    """(T, N)."""
    said_ns: Integers
    """(T, N)."""
    arrived_ns: Integers
    """What the first and second neighbour had said in the tick before, (T, N, 2)."""


def board_times(timings: Sequence[tuple[int, Timing]], ticks: int, boards: int) -> BoardTimes:
    """Times that boards told of the ticks 0 ... T-1; of what they did not get to tell, 0."""
    kinds = len(TickTiming._fields)
    told_ns = np.zeros((ticks, boards, kinds), np.int64)
    for board, timing in timings:
        us = np.array(timing.ticks, np.int64).reshape(-1, kinds)
        ns = np.where(us < 0, 0, timing.base_ns + us * 1000)
        first, last = max(0, timing.tick), min(ticks, timing.tick + len(us))
        if first < last:
            told_ns[first:last, board] = ns[first - timing.tick : last - timing.tick]
    return BoardTimes(
        taken_up_ns=told_ns[..., 0],
        decided_ns=told_ns[..., 1],
        said_ns=told_ns[..., 2],
        arrived_ns=told_ns[..., 3:],
    )


def clocks_shared(facts: dict[str, Any], timings: Sequence[tuple[int, Timing]]) -> bool:
    """Whether all processes of a run said that they read one clock."""
    clocks = {facts.get("clock", 0), *(timing.clock for _, timing in timings)}
    return bool(timings) and len(clocks) == 1 and 0 not in clocks


def efforts(
    joints: Sequence[str], facts: dict[str, Any], timings: Sequence[tuple[int, Timing]]
) -> dict[str, tuple[float, float]]:
    """CPU seconds and peak memory in MB of each process, by "plant" or "twin", or its joint.

    Of a joint that had several boards, one after the other: seconds of all, memory of the largest.
    """
    found: dict[str, tuple[float, float]] = {}
    if "cpu_s" in facts:
        name = TWIN if facts.get("mode") == TWIN else PLANT
        found[name] = (facts["cpu_s"], facts["memory_kb"] / KB_PER_MB)
    last = {(board, timing.incarnation): timing for board, timing in timings}
    for (board, _), timing in sorted(last.items(), key=lambda entry: entry[0]):
        cpu_s, memory_mb = found.get(joints[board], (0.0, 0.0))
        seconds, megabytes = timing.cpu_us / 1e6, timing.memory_kb / KB_PER_MB
        found[joints[board]] = (cpu_s + seconds, max(memory_mb, megabytes))
    return found
