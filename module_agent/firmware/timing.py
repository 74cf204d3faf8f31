"""Timing: when a board did what, gathered over some ticks for a plant that records.

    timing.arrived(link, said_tick, now_ns)          for each frame of a neighbour
    timing.ticked(tick, taken_up, decided, said)     after each tick
    if timing.due: put(timing.frame(effort))         and the rest at the end of the run

Rule 1: no clock. It is given readings of the board's monotonic clock, in nanoseconds.
Rule 2: nothing that a board does depends on it, and nobody waits for what it says.
Rule 3: a frame holds what surely fits: ticks that lie close together, or one tick alone.
"""

from protocol.process.machine import Effort
from protocol.wire.frames import encode
from protocol.wire.timing import TickTiming, Timing

TICKS_MAX = 12
SPAN_NS_MAX = 0xFFFF * 1000
"""Microseconds up to here take three bytes, so twelve ticks of five numbers fit into a frame."""
ARRIVALS_MAX = 4
"""Of a neighbour that is heard, one frame waits for its tick, and one more may have come early."""
NEVER = -1
NEVER_NS = 2**64
"""While it is kept: later than anything that happens."""
Stamps = tuple[int, int, int, int, int]
"""The fields of `TickTiming`, as readings of the clock."""


class BoardTiming:
    """Wall times of one board until they are said; `clock` names the clock that they are of."""

    def __init__(self, *, clock: int) -> None:
        self.clock = clock
        self.begin(0, 0)

    def begin(self, run_id: int, incarnation: int) -> None:
        """Forget everything: the board has been let in, perhaps again."""
        self.run_id = run_id
        self.incarnation = incarnation
        self.ticks: list[Stamps] = []
        """Ticks that are not said yet."""
        self._next_tick = 0
        self._arrivals: tuple[dict[int, int], dict[int, int]] = {}, {}
        """Of each link: when what was said in which tick arrived."""

    def arrived(self, link: int, said_tick: int, now_ns: int) -> None:
        """Note that a frame of the `link`-th neighbour is here; its first copy counts."""
        arrivals = self._arrivals[link]
        arrivals.setdefault(said_tick, now_ns)
        if len(arrivals) > ARRIVALS_MAX:
            del arrivals[min(arrivals)]

    def ticked(self, tick: int, taken_up_ns: int, decided_ns: int, said_ns: int) -> None:
        """Note a tick. Ticks come one after the other, without gaps."""
        first, second = self._arrivals
        first_ns, second_ns = first.pop(tick - 1, NEVER_NS), second.pop(tick - 1, NEVER_NS)
        self.ticks.append((taken_up_ns, decided_ns, said_ns, first_ns, second_ns))
        self._next_tick = tick + 1

    @property
    def due(self) -> bool:
        """Whether there is enough for a frame."""
        return len(self.ticks) >= TICKS_MAX

    def frame(self, effort: Effort) -> bytes:
        """Take the oldest ticks, as many as fit, and write them down."""
        first_tick = self._next_tick - len(self.ticks)
        said = self.ticks
        while (base_ns := min(map(min, said))) + SPAN_NS_MAX < said[-1][2] and len(said) > 1:
            said = said[:-1]
        self.ticks = self.ticks[len(said) :]
        entries = [
            TickTiming._make([NEVER if ns == NEVER_NS else (ns - base_ns) // 1000 for ns in stamps])
            for stamps in said
        ]
        about = (self.run_id, self.incarnation, first_tick, base_ns, self.clock)
        return encode(Timing(*about, effort.cpu_us, effort.memory_kb, tuple(entries)))
