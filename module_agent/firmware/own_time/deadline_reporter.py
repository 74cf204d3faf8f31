"""Strain: what keeps a board from its deadlines, in one line now and then.

Rule 1: a line says how many deadlines were missed since the last one, how late the worst was, why.
Rule 2: lines are at least a second apart; while it goes on, twice as long each time, up to 8 s.
Rule 3: a turn that computes for longer than a period has itself to blame. Otherwise the processor
        was busy with something else: the turn began late, or was interrupted.
Rule 4: an observation that has not come for so long that the board may not drive any more is told
        alike; who is to blame for that sits at the other end.
"""

from collections.abc import Iterator
from typing import NamedTuple

SHORTEST_NS = 1_000_000_000
LONGEST_NS = 8 * SHORTEST_NS
MS = 1e-6
"""Milliseconds in a nanosecond."""


class TurnAccount(NamedTuple):
    """A turn of the loop, when it is done."""

    done_ns: int
    missed: int
    """Periods whose torque was late, or never came."""
    late_ns: int
    """How long after the end of the first period that it is for."""
    computing_ns: int
    """Processor time that it took."""
    silent_ns: int
    """Time since the latest observation came."""


class DeadlineReporter:
    """Missed deadlines of one board, for people."""

    def __init__(self, *, period_ns: int, silent_ns_max: int) -> None:
        self.period_ns = period_ns
        self.silent_ns_max = silent_ns_max
        self.missed = 0
        """All of them."""
        self._told = 0
        self._since_ns: int | None = None
        self._quiet_ns = SHORTEST_NS
        self._worst_ns = 0
        self._computing_ns = 0
        self._silent_ns = 0

    def turned(self, turn: TurnAccount) -> str | None:
        """Take a turn; return a line if there is something to say and it is time to."""
        self.missed += turn.missed
        if turn.missed:
            self._worst_ns = max(self._worst_ns, turn.late_ns)
            self._computing_ns = max(self._computing_ns, turn.computing_ns)
        if turn.silent_ns > self.silent_ns_max:
            self._silent_ns = max(self._silent_ns, turn.silent_ns)
        if self._since_ns is None:
            self._since_ns = turn.done_ns
        since_ns = turn.done_ns - self._since_ns
        if since_ns < self._quiet_ns:
            return None
        lines = [*self._missed_lines(since_ns), *self._silent_lines()]
        self._quiet_ns = min(2 * self._quiet_ns, LONGEST_NS) if lines else SHORTEST_NS
        self._told, self._since_ns = self.missed, turn.done_ns
        self._worst_ns = self._computing_ns = self._silent_ns = 0
        return "; ".join(lines) or None

    def _silent_lines(self) -> Iterator[str]:
        if self._silent_ns:
            yield (
                f"no observation for up to {self._silent_ns * MS:.0f} ms, and no torque"
                f" meanwhile: the plant is held up, or not to be reached"
            )

    def _missed_lines(self, since_ns: int) -> Iterator[str]:
        missed = self.missed - self._told
        if not missed:
            return
        if self._computing_ns >= self.period_ns:
            why = (
                f"a turn takes up to {self._computing_ns * MS:.1f} ms of computing,"
                f" its period is {self.period_ns * MS:g} ms; choose a lower rate_hz"
            )
        else:
            why = "the host is busy"
        plural = "deadline" if missed == 1 else "deadlines"
        yield (
            f"{missed} {plural} missed in the last {since_ns * 1e-9:.0f} s,"
            f" worst {self._worst_ns * MS:.1f} ms late: {why}"
        )
