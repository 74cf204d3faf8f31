"""How long things took: to agree, to decide, a frame on its way, a tick, and for whom it waited.

Rule 1: a time that is not known (0 ns) is in no statistic, and how many are in it is told.
Rule 2: times of two clocks are subtracted only where both are one clock.
Rule 3: percentiles are nearest-rank, here as in `decmesh measure`: each is a value that there was.
"""

from typing import NamedTuple

import numpy as np

from deploy.recording.arrays import LinkHistory, Recording
from deploy.recording.epochs import Epochs
from deploy.recording.trajectory import Floats, Integers

PERCENTILES = (50.0, 90.0, 99.0)


class Distribution(NamedTuple):
    """How values lie, in their unit."""

    known: int
    """How many values there are."""
    p50: float
    p90: float
    p99: float
    most: float


class WaitCounts(NamedTuple):
    """For whom the plant waited: the board whose answer was the last of a tick."""

    ticks: int
    """Ticks in which at least two boards answered, and it is known when."""
    last: Integers
    """In how many of them each board was the last, (N,)."""
    alone_ns: Floats
    """How long after the answer before it the last one came, one entry for each of `ticks`."""
    whose: Integers
    """Which board that was, one entry for each of `ticks`."""


def spread(values: Floats) -> Distribution | None:
    """Percentiles of all values that are numbers; None if there are none."""
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    p50, p90, p99 = np.percentile(known, PERCENTILES, method="inverted_cdf").tolist()
    return Distribution(len(known), p50, p90, p99, float(known.max()))


def between_ns(first_ns: Integers, then_ns: Integers) -> Floats:
    """From one time to another; NaN where either is not known."""
    known = (first_ns > 0) & (then_ns > 0)
    return np.where(known, (then_ns - first_ns).astype(np.float64), np.nan)


def decisions_ns(recording: Recording, epochs: Epochs) -> Floats:
    """From the opening of an epoch's first tick until each member had decided, (E, N).

    A board has decided when it has thought the tick through in which it latches. Where its clock is
    not the plant's, it counts when the plant had its answer. NaN: no member, or not known.
    """
    decided_ns = recording.decided_ns if recording.clocks_shared else recording.answered_ns
    opened_ns = recording.opened_ns[epochs.first_tick][:, None]
    took_ns = between_ns(opened_ns, decided_ns[epochs.latch_tick])
    return np.where(epochs.members, took_ns, np.nan)


def ways_ns(link: LinkHistory) -> Floats:
    """How long each frame was on its way, (T,); for boards that read one clock."""
    return between_ns(link.sent_ns, link.arrived_ns)


def ticks_ns(recording: Recording) -> Floats:
    """From the opening of each tick until the plant had all answers and had closed it, (T,)."""
    return between_ns(recording.opened_ns, recording.closed_ns)


def gaps_ns(recording: Recording) -> Floats:
    """From the end of each tick to the opening of the next, (T - 1,)."""
    return between_ns(recording.closed_ns[:-1], recording.opened_ns[1:])


def waits(recording: Recording) -> WaitCounts:
    """Find for whom the plant waited, tick by tick."""
    answered_ns = recording.answered_ns
    boards = answered_ns.shape[1]
    compared = answered_ns[(answered_ns > 0).sum(axis=1) >= min(2, boards)]
    whose = compared.argmax(axis=1)
    if boards > 1:
        ordered = np.sort(compared, axis=1)
        alone_ns = (ordered[:, -1] - ordered[:, -2]).astype(np.float64)
    else:
        alone_ns = np.full(len(compared), np.nan)
    return WaitCounts(len(compared), np.bincount(whose, minlength=boards), alone_ns, whose)
