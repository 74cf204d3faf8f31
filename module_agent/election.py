"""The election as a board lives it: epochs that come with the ticks, and what to do when in doubt.

Epoch e begins at tick e T_e with the board's own urgency; in each of the next R ticks one round of
max-consensus is played; at the end of the last the board latches y (S10, S11). An epoch is complete
for a board that in every round heard this epoch from every neighbour on the roster. When it is not,
either each side of the gap latches the best it knows (`each-side`), or y stays as it was
(`keep-last`) (S12).
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.consensus import Gossip, MaxConsensus


class ElectionConfig(NamedTuple):
    """When boards elect, and what they do when they have not heard from everybody."""

    period_ticks: int
    rounds: int
    keeps_last: bool


class Heard(NamedTuple):
    """Gossip, and on which of the board's links it came."""

    link: int
    gossip: Gossip


class Election:
    """The enabling variable y of one board."""

    def __init__(self, config: ElectionConfig, *, board: int) -> None:
        self.config = config
        self.consensus = MaxConsensus(
            board=board, period_ticks=config.period_ticks, rounds=config.rounds
        )
        self.enabled = True
        self.incomplete_epochs = 0
        self._complete = True

    def due(self, tick: int) -> bool:
        """Whether there is an epoch to open or a round to play; else a tick changes nothing."""
        consensus = self.consensus
        return consensus.round < consensus.rounds or tick % consensus.period_ticks == 0

    def tick(
        self, tick: int, urgency: float, heard: Sequence[Heard], rostered: Sequence[int]
    ) -> None:
        """Hear, then open an epoch, or end a round and latch y if it was the last.

        `rostered` are the links at whose other end the plant says that there is a board.
        """
        consensus = self.consensus
        for _link, gossip in heard:
            consensus.hear(gossip)
        if tick % consensus.period_ticks == 0:
            consensus.begin(tick, urgency)
            self._complete = True
            return
        if consensus.round < consensus.rounds:
            said = {link for link, gossip in heard if gossip.epoch == consensus.epoch}
            self._complete = self._complete and said.issuperset(rostered)
        if consensus.advance():
            self._latch()

    def _latch(self) -> None:
        if not self._complete:
            self.incomplete_epochs += 1
            if self.config.keeps_last:
                return
        self.enabled = self.consensus.elected
