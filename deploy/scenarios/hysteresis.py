"""An election with hysteresis: who moves goes on until another is worse by a margin.

While a board is enabled, it claims a margin more than its own urgency. The margin is in what is
said, so all boards compare the same numbers: the maximum is one, and so is the winner.
"""

from math import radians

from module_agent.firmware.config import BoardConfig
from module_agent.firmware.controller import Candidate, Round, Vote

MARGIN = radians(2.0)


class Hysteresis:
    """Max-consensus with a bonus for the board that moves."""

    def __init__(self, config: BoardConfig) -> None:
        self.board = config.index
        self.best = self.own = Candidate(0.0, self.board)

    def vote(self, now: Round) -> Vote:
        """Open an epoch with the own claim; in each round, keep the largest claim heard."""
        if now.number == 0:
            claim = now.urgency + (MARGIN if now.enabled else 0.0)
            self.best = self.own = Candidate(claim, self.board)
        self.best = max([self.best, *now.heard])
        return Vote(self.best, enabled=self.best == self.own)
