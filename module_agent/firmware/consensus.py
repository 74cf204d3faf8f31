"""Max-consensus: the boards agree on which one of them moves next (paper, section III-C).

Rule 1: no clock, no I/O, no randomness. Time is the number of the round.
Rule 2: this file ranks urgencies. It knows nothing of torque.

Every board starts an epoch with its own urgency and, round by round, keeps the largest that it
and its neighbours know of (eq. consProt). After as many rounds as the network has hops across,
all know the largest (eq. achievedMaxCons), and the one board whose own it is enables itself
(eq. computeY). Maximum is commutative, associative and idempotent: gossip may repeat, change order
or come late, and loss only delays agreement.
"""

from typing import Protocol

from module_agent.firmware.controller import Candidate, Round, Vote


class HasIndex(Protocol):
    """What is known of the board: a `BoardConfig`, or that of a board without a body."""

    @property
    def index(self) -> int:
        """Which board it is."""
        ...


class MaxConsensus:
    """The election of one board, epoch after epoch."""

    def __init__(self, config: HasIndex) -> None:
        self.board = config.index
        self.best = self._own = Candidate(0.0, self.board)

    def vote(self, now: Round) -> Vote:
        """Open an epoch with the own urgency (w_i0), or take the maximum with what was heard."""
        if now.number == 0:
            self.best = self._own = Candidate(now.urgency, self.board)
        self.best = max([self.best, *now.heard])
        return Vote(self.best, self.best == self._own)
