"""The cycle of a board in realtime: its firmware, its loop, and the account of both.

    cycle.observed(payload, arrived_ns)      as things arrive
    cycle.board.hear(link, payload)
    turn = cycle.wake(now_ns)                at `cycle.next_ns`
    for slot in turn.slots:
        actuation = cycle.board.play(slot)   and say it
        trace = cycle.said(slot, now_ns)     a frame for the plant when one is full
    words = cycle.last_words()               frames for the plant when a neighbour is gone
    line = cycle.turned(now_ns, spent_ns)    something to tell the user, seldom

Rule: it has no clock. Whoever drives it brings the time, and does the waiting and the telling.
"""

from module_agent.firmware.config import BoardConfig
from module_agent.firmware.own_time.board import OwnTimeBoard
from module_agent.firmware.own_time.deadline_reporter import DeadlineReporter, TurnAccount
from module_agent.firmware.own_time.pacing import LoopTurn, PeriodicLoop
from protocol.wire.frames import encode
from protocol.wire.trace import Mark, TickTrace
from protocol.wire.trace_differences import TraceWriter


class Cycle:
    """One board from its admission on, with a clock that is brought to it."""

    def __init__(self, board: OwnTimeBoard, config: BoardConfig) -> None:
        """`config` is the board's in the plant's ticks."""
        own_time, tick_ns = board.own_time, round(config.tick_s * 1e9)
        self.board = board
        self.loop = PeriodicLoop(
            tick_ns=tick_ns,
            ticks_per_period=own_time.ticks_per_period,
            phase=(config.boards - config.index) / (config.boards + 1),
            catches_up=own_time.cadence.catches_up,
        )
        self.deadline_reporter = DeadlineReporter(
            period_ns=self.loop.period_ns, silent_ns_max=own_time.cadence.age_ticks_max * tick_ns
        )
        self._observed_ns = 0
        self._writer = TraceWriter(
            run_id=board.board.run_id,
            incarnation=board.board.incarnation,
            links=len(config.neighbours),
        )
        self._woke_ns = 0
        self._turn = LoopTurn((), 0, 0, 0)
        self._skipped = 0
        self._missed = 0

    @property
    def next_ns(self) -> int | None:
        """When to wake up; None before the first observation."""
        return self.loop.next_ns

    def observed(self, payload: bytes, arrived_ns: int) -> None:
        """Take an observation. Raises as `OwnTimeBoard.observe` does."""
        self.board.observe(payload)
        self.loop.observed(self.board.seen_tick, arrived_ns)
        self._observed_ns = arrived_ns

    def wake(self, now_ns: int) -> LoopTurn | None:
        """What there is to play; None if nothing is due."""
        turn = self.loop.wake(now_ns)
        if turn is not None:
            self._woke_ns, self._turn = now_ns, turn
            self._skipped = self._missed = turn.skipped
        return turn

    def said(self, slot: int, now_ns: int) -> bytes | None:
        """Write down what was played in a slot; its torque is on the way."""
        turn, last = self._turn, self._turn.slots[-1]
        assert self.loop.next_ns is not None
        used = self.board.used
        late = slot != last or now_ns > self.loop.next_ns
        self._missed += late
        lived = TickTrace(
            slot=slot,
            woke_us=self._woke_ns // 1000,
            late_us=turn.late_ns // 1000,
            busy_us=(now_ns - self._woke_ns) // 1000,
            phase_us=(turn.phase_ns + (last - slot) * self.loop.period_ns) // 1000,
            seen_tick=used.seen_tick,
            skipped=self._skipped,
            marks=int(used.marks | (Mark.LATE if late else 0)),
            taken=used.taken,
        )
        self._skipped = 0
        return self._writer.add(lived)

    def turned(self, now_ns: int, computing_ns: int) -> str | None:
        """End a turn; return a line for the user if there is one, and it is time for it."""
        late_ns = self._turn.late_ns + now_ns - self._woke_ns - self.loop.period_ns
        silent_ns = now_ns - self._observed_ns
        return self.deadline_reporter.turned(
            TurnAccount(now_ns, self._missed, late_ns, computing_ns, silent_ns)
        )

    def last_words(self) -> list[bytes]:
        """Frames for the plant: what was heard last of neighbours that are gone."""
        words = self.board.last_words
        if not words:
            return []
        self.board.last_words = []
        return [encode(word) for word in words]

    def rest(self) -> bytes | None:
        """What has not been told yet of what was played."""
        return self._writer.flush()
