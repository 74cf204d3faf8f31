"""The election when nobody is waited for: rounds that come with time, not with a barrier.

Rule 1: an election lives in rounds of so many plant ticks, numbered alike by every board from what
        it knows of the plant's tick. What a round is to it, a tick is to an election in lockstep:
        said in round r, heard before round r + 1 is played.
Rule 2: a round is played once, in the first period that begins in it, with all that was heard since
        the one before. Rounds that a board has slept through are played with nothing heard.
Rule 3: a board that comes late to an epoch, but before its last round, passes on what it hears and
        does not stand itself (w = 0): the others could not hear of it any more. After that it has
        missed the epoch, and its y stays as it was.
"""

from collections.abc import Sequence

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.controller import ElectionRule
from module_agent.firmware.election import Election, Heard
from protocol.wire.trace import Mark


class RealtimeElection(Election):
    """An `Election` whose ticks are rounds; it is told own periods."""

    def __init__(
        self,
        config: ElectionConfig,
        rule: ElectionRule,
        *,
        board: int,
        ticks_per_period: int,
        ticks_per_round: int,
    ) -> None:
        self._epoch_ticks = config.period_ticks
        self._ticks_per_period = ticks_per_period
        self._ticks_per_round = ticks_per_round
        self._rounds_per_epoch = config.period_ticks // ticks_per_round
        own = config._replace(period_ticks=self._rounds_per_epoch)
        super().__init__(own, rule, board=board)
        self.marks = Mark(0)
        """What the last period meant for the epoch."""
        self._played: int | None = None
        self._heard: list[Heard] = []

    def due(self, tick: int) -> bool:
        """Whether there is something to play or to listen to: always."""
        del tick
        return True

    def tick(
        self, tick: int, urgency: float, heard: Sequence[Heard], rostered: Sequence[int]
    ) -> None:
        """Listen; in the first period of a round, play it."""
        self.marks = Mark(0)
        self._heard += heard
        now, first = self._round(tick * self._ticks_per_period)
        played = self._played
        if now == played:
            return
        if played is None and now != first:
            self._played = now  # It has come in the middle: the next epoch is its first (S11).
            return
        self.marks = self._play(played, now, first, urgency, rostered)
        self._played = now
        self._heard.clear()

    def _round(self, tick: int) -> tuple[int, int]:
        """Number of the round that a plant tick is in, and of the first one of its epoch."""
        epoch, ticks = divmod(tick, self._epoch_ticks)
        first = epoch * self._rounds_per_epoch
        return first + min(ticks // self._ticks_per_round, self._rounds_per_epoch - 1), first

    def _play(
        self, played: int | None, now: int, first: int, urgency: float, rostered: Sequence[int]
    ) -> Mark:
        start, marks = now, Mark(0)
        if played is not None and played >= first:
            start = played + 1
        elif now != first:
            if now - first >= self.config.rounds:
                return Mark.MISSED_EPOCH
            start, urgency, marks = first, 0.0, Mark.MISSED_EPOCH
        else:
            marks = Mark.BEGAN
        playing = self._playing or start == first
        for slept in range(start, now):
            super().tick(slept, urgency, (), rostered)
            self._played = slept  # A rule from outside may fail in the middle, and is replaced.
        super().tick(now, urgency, self._heard, rostered)
        if playing and now != first and not self._playing:
            marks |= Mark.LATCHED
        return marks
