"""Clocks: how a board's own clock differs from the plant's, in logical time.

Rule: the tick stays the only clock. A clock that is off is a function of seed, board and tick, so
the plant and the board agree about it without a word, and a run can be played again.

A board with a clock of its own reads its sensors a little before each tick of the plant, never in
step with it. With skew s (in parts, positive: fast) and a phase p at the start,

    age(k) = frac(p + s k) + jitter(k)        ticks

is how old its readings are in tick k. Where p + s k passes a whole number downwards, a slow clock
has fallen a whole tick behind, and the board is *late*: its loop has not ended when the tick does.
So it is in the ticks of an *overrun*. A fast clock plays a tick twice now and then, which says the
same again and changes nothing.
"""

from math import floor

from protocol.robot.chance import JITTER, PHASE, START_UP, Chance
from protocol.robot.hardware import ClockSheet


class Clock:
    """One board's clock, seen from the plant's ticks."""

    def __init__(self, sheet: ClockSheet, *, seed: int, board: int, tick_s: float) -> None:
        self._skew = sheet.skew_ppm * 1e-6
        self._jitter_ticks = sheet.jitter_s / tick_s
        self._start_up = sheet.start_up_ticks, sheet.start_up_jitter_ticks
        self._overruns = frozenset(sheet.overrun_ticks)
        self._chance = Chance(seed=seed, board=board)
        self._phase = self._chance.uniform(0, PHASE) if self._skew else 0.0

    def age_ticks(self, tick: int) -> float:
        """How much older than a tick the readings are that a board has in it, 0 to 2 ticks."""
        phase = self._phase + self._skew * tick
        age_ticks = phase - floor(phase)
        if self._jitter_ticks:
            age_ticks += self._jitter_ticks * self._chance.uniform(tick, JITTER)
        return age_ticks

    def late(self, tick: int) -> bool:
        """Whether the board's loop does not end within a tick; never in the warm-up."""
        if tick < 0:
            return False
        slow = self._skew < 0.0
        return tick in self._overruns or (slow and self._turns(tick) < self._turns(tick - 1))

    def start_up_ticks(self, tick: int) -> int:
        """How long a board that is plugged in at a tick takes to be there."""
        least, jitter = self._start_up
        return least + (self._chance.draw(tick, START_UP) % (jitter + 1) if jitter else 0)

    def _turns(self, tick: int) -> int:
        return floor(self._phase + self._skew * tick)
