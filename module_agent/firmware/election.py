"""The election as a board lives it: epochs that come with the ticks, and what to do when in doubt.

Epoch e begins at tick e T_e with the board's own urgency; in each of the next R ticks one round is
played; at the end of the last the board latches y (S10, S11). An epoch is complete for a board that
in every round heard this epoch from every neighbour on the roster. When it is not, either each side
of the gap latches the best it knows (`each-side`), or y stays as it was (`keep-last`) (S12).

What is said and who wins is up to a rule, `MaxConsensus` unless the scenario names another; when
it is played, and what counts as heard, is not.
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import MaxConsensus, Numbered
from module_agent.firmware.controller import Candidate, ElectionRule, Round
from protocol.wire.frames import NO_EPOCH


class Gossip(NamedTuple):
    """What one round says to the neighbours."""

    epoch: int
    round: int
    best: Candidate


class Heard(NamedTuple):
    """Gossip, and on which of the board's links it came."""

    link: int
    gossip: Gossip


class Election:
    """The enabling variable y of one board."""

    def __init__(self, config: ElectionConfig, rule: ElectionRule, *, board: int) -> None:
        assert 0 < config.rounds < config.period_ticks
        self.config = config
        self.rule = rule
        self.enabled = True
        self.incomplete_epochs = 0
        self.gossip = Gossip(NO_EPOCH, config.rounds, Candidate(0.0, board))
        """What the neighbours should hear. Nothing is played before the first epoch begins."""
        self._complete = True
        self._playing = False
        self._period_ticks = config.period_ticks

    def due(self, tick: int) -> bool:
        """Whether there is an epoch to open or a round to play; else a tick changes nothing."""
        return self._playing or tick % self._period_ticks == 0

    def tick(
        self, tick: int, urgency: float, heard: Sequence[Heard], rostered: Sequence[int]
    ) -> None:
        """Open an epoch, or play a round and latch y if it was the last.

        `rostered` are the links at whose other end the plant says that there is a board.
        """
        epoch, number, _best = self.gossip
        candidates: list[Candidate] = []
        if tick % self._period_ticks == 0:
            epoch, number = tick // self._period_ticks, 0
            self._complete = True
        elif self._playing:
            number += 1
            said = {link for link, gossip in heard if gossip.epoch == epoch}
            self._complete = self._complete and said.issuperset(rostered)
            candidates = [gossip.best for _link, gossip in heard if gossip.epoch == epoch]
        else:
            return
        last = number == self.config.rounds
        now = Round(tick, epoch, number, last, urgency, candidates, self._complete, self.enabled)
        best, enabled = self.rule.vote(now)
        self.gossip = Gossip(epoch, number, best)
        self._playing = not last
        if last:
            self._latch(enabled=enabled)

    def relay(self, config: Numbered) -> None:
        """Have no say any more, but pass on what others say: a chain is as wide as ever."""
        rule = MaxConsensus(config)
        rule.best = self.gossip.best
        self.rule, self.enabled = rule, False

    def _latch(self, *, enabled: bool) -> None:
        if not self._complete:
            self.incomplete_epochs += 1
            if self.config.keeps_last:
                return
        self.enabled = enabled
