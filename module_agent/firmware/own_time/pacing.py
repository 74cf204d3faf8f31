"""Pacing: a loop at a fixed rate on a board's own clock, and which slots of the run it plays.

Rule 1: period n begins at start + n periods, on a clock that nobody corrects: lateness of one does
        not delay the next.
Rule 2: a deadline is missed when what a period has to say is said after its end, or never. Who
        wakes up too late skips what was missed, or makes up for it (at most `CATCH_UP_MAX`).
Rule 3: slots are the board's periods by the plant's ticks: slot s begins with tick s * (ticks per
        period). A board counts slots along with its own periods. Its clock drifts against the
        plant's: when the count is half a slot early or late, one is waited for or passed over.

Pure: whoever drives this brings the time, in ns of one monotonic clock, and does the waiting.
"""

from math import floor
from typing import NamedTuple

from module_agent.firmware.own_time.plant_clock import PlantClock

CATCH_UP_MAX = 10
"""More than this is not worth making up for: the samples are too old."""
EARLY_SLOTS_MAX = 0.5
LATE_SLOTS_MAX = 1.5
"""A slot is played within this of its beginning; from 0 to 1 if the clocks agreed."""


class DuePeriods(NamedTuple):
    """Periods that have begun since the last time."""

    periods: int
    late_ns: int
    """Time since the first of them began."""


class Deadlines:
    """When periods begin and end."""

    def __init__(self, *, start_ns: int, period_ns: int) -> None:
        self.start_ns = start_ns
        self.period_ns = period_ns
        self._begun = 0
        """How many periods have begun."""

    @property
    def next_ns(self) -> int:
        """When the next period begins, and the one before has to be done."""
        return self.start_ns + self._begun * self.period_ns

    def wake(self, now_ns: int) -> DuePeriods | None:
        """The periods that have begun; None if none has."""
        late_ns = now_ns - self.next_ns
        if late_ns < 0:
            return None
        periods = 1 + late_ns // self.period_ns
        self._begun += periods
        return DuePeriods(periods, late_ns)


class Slots:
    """Counts slots along with a board's own periods."""

    def __init__(self) -> None:
        self.last: int | None = None
        """The slot that was played last."""

    def after(self, periods: int, position: float) -> int | None:
        """The slot to play now, `periods` after the last one; None if it was played already.

        `position` is where the plant is, in slots.
        """
        if self.last is None:
            self.last = floor(position)
            return self.last
        slot = self.last + periods
        if not -EARLY_SLOTS_MAX <= position - slot < LATE_SLOTS_MAX:
            slot = floor(position)
        if slot <= self.last:
            return None
        self.last = slot
        return slot


class LoopTurn(NamedTuple):
    """What a board has to do when it wakes up."""

    slots: tuple[int, ...]
    """To play, in order; only the last of them can be in time. Empty: the plant is not that far."""
    skipped: int
    """Periods that are missed and not made up for."""
    late_ns: int
    phase_ns: int
    """Time since the last of the slots began, by the plant's ticks."""


class PeriodicLoop:
    """The loop of one board, from its first observation on.

    `phase` is where in the plant's period the own ones begin, as a share: boards that take turns
    do not wait for each other's cores. It is chosen once; after that the clocks go as they go.
    """

    def __init__(
        self, *, tick_ns: int, ticks_per_period: int, phase: float, catches_up: bool
    ) -> None:
        self.period_ns = ticks_per_period * tick_ns
        self.clock = PlantClock(tick_ns=tick_ns)
        self.slots = Slots()
        self._ticks_per_period = ticks_per_period
        self._catches_up = catches_up
        self._phase_ns = round(phase * self.period_ns)
        self._deadlines: Deadlines | None = None

    @property
    def next_ns(self) -> int | None:
        """When to wake up, and by when to be done; None before the first observation."""
        return None if self._deadlines is None else self._deadlines.next_ns

    def observed(self, tick: int, arrived_ns: int) -> None:
        """An observation has come; the first one starts the loop."""
        self.clock.hear(tick, arrived_ns)
        if self._deadlines is None:
            into_period_ns = tick % self._ticks_per_period * self.clock.tick_ns
            start_ns = arrived_ns - into_period_ns + self._phase_ns
            self._deadlines = Deadlines(start_ns=start_ns, period_ns=self.period_ns)

    def wake(self, now_ns: int) -> LoopTurn | None:
        """What there is to do; None if it is too early for anything."""
        due = None if self._deadlines is None else self._deadlines.wake(now_ns)
        if due is None:
            return None
        position = self.clock.tick_at(now_ns) / self._ticks_per_period
        before = self.slots.last
        slot = self.slots.after(due.periods, position)
        if slot is None:
            return LoopTurn((), due.periods - 1, due.late_ns, 0)
        first = slot
        if self._catches_up and before is not None:
            first = max(before + 1, slot - CATCH_UP_MAX + 1)
        slots = tuple(range(first, slot + 1))
        skipped = max(0, due.periods - len(slots))
        phase_ns = round((position - slot) * self.period_ns)
        return LoopTurn(slots, skipped, due.late_ns, phase_ns)
