"""Pace: the body's time tied to the wall clock.

Rule 1: tick k is due k tick lengths, divided by the pace, after tick 0: lateness never adds up.
Rule 2: who is late catches up as fast as it can. Who is later than `SLIP_S` gives that time up: the
        clock is set back, and how much was given up is kept. So a host that is too slow is told by
        a number, and a debugger's pause is not followed by a rush.

Pure: whoever drives this brings the time and does the waiting.
"""

SLIP_S = 0.1


class Pace:
    """When ticks are due; the first tick that is asked about is due at once."""

    def __init__(self, *, tick_s: float, pace: float = 1.0) -> None:
        assert pace > 0.0
        self.pace = pace
        self.tick_wall_s = tick_s / pace
        self.slipped_s = 0.0
        """Wall time that was given up."""
        self.behind_s_max = 0.0
        """How late the latest tick was."""
        self._zero_s: float | None = None

    def wait_s(self, tick: int, now_s: float) -> float:
        """How long to wait until a tick is due; 0.0 when it is due, or was."""
        if self._zero_s is None:
            self._zero_s = now_s - tick * self.tick_wall_s
        early_s = self._zero_s + tick * self.tick_wall_s - now_s
        if early_s >= 0.0:
            return early_s
        self.behind_s_max = max(self.behind_s_max, -early_s)
        if -early_s > SLIP_S:
            self._zero_s -= early_s
            self.slipped_s -= early_s
        return 0.0
