"""Median and range of a few repeats: what can honestly be said of five numbers."""

import statistics
from collections.abc import Sequence
from typing import NamedTuple


class Spread(NamedTuple):
    """Middle, least and most, and of how many."""

    median: float
    low: float
    high: float
    of: int

    def apart(self, other: "Spread") -> bool:
        """Whether no value of one lies within the range of the other."""
        return self.high < other.low or other.high < self.low


def spread(values: Sequence[float]) -> Spread:
    """Summarise repeats. Raises ValueError if there are none."""
    if not values:
        raise ValueError("nothing was measured")
    return Spread(statistics.median(values), min(values), max(values), len(values))
