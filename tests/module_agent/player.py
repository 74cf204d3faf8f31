"""One board's part of an election, played by hand: begin, hear, and end the round."""

from dataclasses import replace

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Candidate
from module_agent.firmware.election import Election, Gossip, HeardGossip
from tests.module_agent.robot import config


class Player:
    """Our rule in our election, with nobody on the roster."""

    def __init__(self, *, board: int, period_ticks: int, rounds: int) -> None:
        self.rule = MaxConsensus(replace(config(0), index=board))
        timing = ElectionConfig(period_ticks, rounds, keeps_last=False)
        self.election = Election(timing, self.rule, board=board)
        self._tick = 0
        self._heard: list[HeardGossip] = []

    @property
    def gossip(self) -> Gossip:
        return self.election.gossip

    @property
    def best(self) -> Candidate:
        """As of the last round that has ended."""
        return self.gossip.best

    @property
    def elected(self) -> bool:
        """Whether it would enable itself if that round were the last."""
        return self.best == self.rule._own

    def begin(self, tick: int, urgency: float) -> None:
        self._tick = tick
        self.election.tick(tick, urgency, [], [])

    def hear(self, gossip: Gossip) -> None:
        self._heard.append(HeardGossip(0, gossip))

    def advance(self) -> bool:
        """End a round; tell whether it was the last one."""
        before = self.gossip.round
        self._tick += 1
        self.election.tick(self._tick, 0.0, self._heard, [])
        self._heard.clear()
        return self.gossip.round != before and self.gossip.round == self.election.config.rounds
