"""The plant's clock as a board knows it: its ticks, by when they arrived on the board's own clock.

Rule 1: an observation can be late, but not early. So the one that was least late in the last while
        tells the time, and the others, or lost ones, change nothing.
Rule 2: in between, and when nothing comes, the own clock goes on. It drifts, so the last while is
        short.
Rule 3: when the newest observation is late by more than `LATE_NS`, it is the plant that is behind,
        for its host is busy. It is followed at that distance until it has caught up.

No clocks are shared: the shortest time that an observation takes is taken for no time at all.
"""

BUCKET_NS = 250_000_000
"""The last while is between one and two of these."""
LATE_NS = 10_000_000


class PlantClock:
    """An estimate of the plant's tick at any time of the board's own clock, in ns."""

    def __init__(self, *, tick_ns: int) -> None:
        self.tick_ns = tick_ns
        self._older_ns: int | None = None
        """Least lateness of the bucket before, as the own time of tick 0."""
        self._newer_ns = self._newest_ns = 0
        """The same of this bucket, and that of the newest observation."""
        self._bucket_ends_ns: int | None = None

    def hear(self, tick: int, arrived_ns: int) -> None:
        """Take the tick of an observation, newer than those before, and when it came."""
        self._newest_ns = zero_ns = arrived_ns - tick * self.tick_ns
        if self._bucket_ends_ns is None or arrived_ns >= self._bucket_ends_ns:
            self._older_ns = zero_ns if self._bucket_ends_ns is None else self._newer_ns
            self._newer_ns, self._bucket_ends_ns = zero_ns, arrived_ns + BUCKET_NS
        else:
            self._newer_ns = min(self._newer_ns, zero_ns)

    def tick_at(self, now_ns: int) -> float:
        """The plant's tick at a time, with its fraction. Needs one observation before."""
        assert self._older_ns is not None, "nothing has been heard of the plant"
        least_late_ns = min(self._older_ns, self._newer_ns)
        return (now_ns - max(least_late_ns, self._newest_ns - LATE_NS)) / self.tick_ns
