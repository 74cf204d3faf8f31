"""The election as a board takes part in it: epochs, their rounds, and what to do when in doubt.

Rounds are numbered from the release of the body on, alike by every board. Epoch e opens with round
e N, in which each board stands with its own urgency; in each of the next R rounds it takes in what
its neighbours said in the one before; at the end of the last it latches y (S10, S11). In lockstep
there is one round a tick. On its own clock a board may pass through several ticks in one round, or
sleep through rounds:

Rule 1: a round is played once, in the first tick that is in it, with all that was heard since the
        one before. Rounds that a board has slept through are played with nothing heard.
Rule 2: a board that comes late to an epoch, but before its last round, passes on what it hears and
        does not stand itself (w = 0): the others could not hear of it any more. After that it has
        missed the epoch, and its y stays as it was.
Rule 3: an epoch is complete for a board that in every round heard this epoch from every neighbour
        on the roster. When it is not, either each side of the gap latches the best it knows
        (`each-side`), or y stays as it was (`keep-last`) (S12).

What is said and who wins is up to a rule, `MaxConsensus` unless the scenario names another; when
it is played, and what counts as heard, is not.
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import HasIndex, MaxConsensus
from module_agent.firmware.controller import Candidate, ElectionRule, Round
from protocol.wire.frames import NO_EPOCH
from protocol.wire.trace import Mark

NOTHING_MARKED = Mark(0)


class Gossip(NamedTuple):
    """What one round says to the neighbours."""

    epoch: int
    round: int
    best: Candidate


class HeardGossip(NamedTuple):
    """Gossip, and on which of the board's links it came."""

    link: int
    gossip: Gossip


class Election:
    """The enabling variable y of one board.

    With `listens_always`, gossip is kept between rounds; in lockstep there is nothing between them.
    """

    def __init__(
        self,
        config: ElectionConfig,
        rule: ElectionRule,
        *,
        board: int,
        listens_always: bool = False,
    ) -> None:
        assert 0 < config.rounds < config.period_rounds
        self.config = config
        self.rule = rule
        self.enabled = True
        self.incomplete_epochs = 0
        self.gossip = Gossip(NO_EPOCH, config.rounds, Candidate(0.0, board))
        """What the neighbours should hear. Nothing is played before the first epoch begins."""
        self.marks = NOTHING_MARKED
        """What the last tick meant for the epoch."""
        self._complete = True
        self._playing = False
        self._played: int | None = None
        self._heard: list[HeardGossip] = []
        self._listens_always = listens_always
        self._period_rounds = config.period_rounds

    def due(self, round_: int) -> bool:
        """Whether there is something to play or to listen to; else a tick changes nothing."""
        return self._playing or self._listens_always or round_ % self._period_rounds == 0

    def tick(
        self, now: int, urgency: float, heard: Sequence[HeardGossip], rostered: Sequence[int]
    ) -> None:
        """Listen; in the first tick of round `now`, play it, and latch y if it was the last.

        `rostered` are the links at whose other end the plant says that there is a board.
        """
        self.marks = NOTHING_MARKED
        self._heard += heard
        played, first = self._played, now - now % self._period_rounds
        if now == played:
            return
        if played is None and now != first:
            self._played = now  # It has come in the middle: the next epoch is its first (S11).
            return
        self.marks = self._catch_up(played, now, first, urgency, rostered)
        self._played = now
        self._heard = []

    def relay(self, config: HasIndex) -> None:
        """Have no say any more, but pass on what others say: a chain is as wide as ever."""
        rule = MaxConsensus(config)
        rule.best = self.gossip.best
        self.rule, self.enabled = rule, False

    def _catch_up(
        self, played: int | None, now: int, first: int, urgency: float, rostered: Sequence[int]
    ) -> Mark:
        """Play all rounds since the last one; tell what that meant for the epoch."""
        start, marks = now, NOTHING_MARKED
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
            self._play(slept, urgency, (), rostered)
            self._played = slept  # A rule from outside may fail in the middle, and is replaced.
        self._play(now, urgency, self._heard, rostered)
        if playing and now != first and not self._playing:
            marks |= Mark.LATCHED
        return marks

    def _play(
        self, now: int, urgency: float, heard: Sequence[HeardGossip], rostered: Sequence[int]
    ) -> None:
        """Open an epoch, or play a round and latch y if it was the last."""
        epoch, number, _best = self.gossip
        candidates: list[Candidate] = []
        if now % self._period_rounds == 0:
            epoch, number = now // self._period_rounds, 0
            self._complete = True
        elif self._playing:
            number += 1
            said = {link for link, gossip in heard if gossip.epoch == epoch}
            self._complete = self._complete and said.issuperset(rostered)
            candidates = [gossip.best for _link, gossip in heard if gossip.epoch == epoch]
        else:
            return
        last = number == self.config.rounds
        told = Round(now, epoch, number, last, urgency, candidates, self._complete, self.enabled)
        best, enabled = self.rule.vote(told)
        self.gossip = Gossip(epoch, number, best)
        self._playing = not last
        if last:
            self._latch(enabled=enabled)

    def _latch(self, *, enabled: bool) -> None:
        if not self._complete:
            self.incomplete_epochs += 1
            if self.config.keeps_last:
                return
        self.enabled = enabled
