"""Max-consensus: the boards agree on which one of them moves next (paper, section III-C).

Rule 1: no clock, no I/O, no randomness. Time is the tick number.
Rule 2: this file ranks urgencies. It knows nothing of torque.

Every board starts an epoch with its own urgency and, round by round, keeps the largest that it
and its neighbours know of (eq. consProt). After as many rounds as the network has hops across,
all know the largest (eq. achievedMaxCons), and the one board whose own it is enables itself
(eq. computeY). Maximum is commutative, associative and idempotent: gossip may repeat, change order
or come late, and loss only delays agreement.
"""

from typing import NamedTuple

from protocol.frames import NO_EPOCH


class Candidate(NamedTuple):
    """Compared field by field, so that equal urgencies still have one maximum."""

    urgency: float
    board: int


class Gossip(NamedTuple):
    """What one round says to the neighbours."""

    epoch: int
    round: int
    best: Candidate


class MaxConsensus:
    """The election of one board, epoch after epoch.

    `period_ticks` is the paper's T_e, `rounds` how many rounds are played before the boards latch.
    """

    def __init__(self, *, board: int, period_ticks: int, rounds: int) -> None:
        assert 0 < rounds < period_ticks
        self.board = board
        self.period_ticks = period_ticks
        self.rounds = rounds
        self.epoch = NO_EPOCH
        self.round = rounds  # Nothing is played before the first epoch begins.
        self.best = Candidate(0.0, board)
        self._own = self.best

    def begin(self, tick: int, urgency: float) -> None:
        """Open the epoch that starts at `tick` with this board's own urgency (w_i0)."""
        assert tick % self.period_ticks == 0
        self.epoch = tick // self.period_ticks
        self.round = 0
        self.best = self._own = Candidate(urgency, self.board)

    def hear(self, gossip: Gossip) -> None:
        """Take the maximum with what a neighbour said (eq. consProt), if it is of this epoch."""
        playing = self.round < self.rounds
        if playing and gossip.epoch == self.epoch and gossip.best > self.best:
            self.best = gossip.best

    def advance(self) -> bool:
        """End a round; tell whether it was the last one, so that it is time to latch."""
        if self.round == self.rounds:
            return False
        self.round += 1
        return self.round == self.rounds

    @property
    def elected(self) -> bool:
        """Whether this board's own urgency is the largest it knows of (eq. computeY)."""
        return self.best == self._own

    @property
    def gossip(self) -> Gossip:
        """What the neighbours should hear after this round."""
        return Gossip(self.epoch, self.round, self.best)
