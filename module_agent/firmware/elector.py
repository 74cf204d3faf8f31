"""A board without a body: all that is left of it is its election, to measure agreement by itself.

Rule 1: nothing is played differently. Election, hearing, faults of links and frames are the
        board's own; what the body would say of urgency is drawn from the seed instead.
Rule 2: neighbours are whichever boards it is given, not only those above and below: any graph.
Rule 3: there is no plant. The barrier is the neighbours' frames of the tick before, and a tick is
        a round: epoch e opens in tick e (W + 1), and W rounds follow.

The board would latch y after R rounds. It plays W >= R of them, so that agreement that comes later
is seen too; gossip after round R cannot change what was known at round R.
"""

from dataclasses import dataclass
from typing import NamedTuple

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Candidate
from module_agent.firmware.election import Election, Gossip, HeardGossip
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.link_model import LinkModel
from protocol.robot.chance import draw
from protocol.robot.events import PERFECT
from protocol.wire.frames import NO_TICK, LinkFrame, Neighbour, encode

RIG = "electors"
INCARNATION = 1
NO_BODY = (0.0,) * 7


@dataclass(frozen=True, slots=True)
class ElectorConfig:
    """One board of a network that does nothing but elect."""

    index: int
    neighbours: tuple[int, ...]
    boards: int
    seed: int
    """Of urgencies and of lost frames."""
    loss: float
    """Of every link, per frame."""
    rounds: int
    """R: after how many rounds the board would latch."""
    watched_rounds: int
    """W: how many rounds of an epoch are played."""

    @property
    def period_ticks(self) -> int:
        """From the start of one epoch to that of the next."""
        return self.watched_rounds + 1


class Ballot(NamedTuple):
    """What one board has to say of one epoch when its last watched round has been played."""

    epoch: int
    urgency: float
    """Its own, w."""
    best: Candidate
    """The largest that it knows of."""
    learned_round: int
    """After how many rounds it knew that; 0 if it is its own."""
    elected: bool
    """Whether it took itself for the one with the largest urgency after round R."""


def joint(board: int) -> str:
    """How a board that drives nothing is called in keys."""
    return f"board{board}"


def urgency(seed: int, board: int, epoch: int) -> float:
    """Draw w of one board in one epoch, uniformly from [0, 1).

    No board has a link to itself, so the fates of frames share no bits with this.
    """
    return (draw(seed, board, board, epoch, 0) >> 11) * 2.0**-53


class Elector:
    """The election of one board, tick after tick from 0."""

    def __init__(self, config: ElectorConfig, *, run_id: int) -> None:
        self.config = config
        self.run_id = run_id
        self.next_tick = 0
        self.urgency = 0.0
        self.learned_round = 0
        self.hearings = [
            Hearing(
                LinkModel(
                    seed=config.seed,
                    sender=sender,
                    receiver=config.index,
                    standing=PERFECT._replace(loss=config.loss),
                ),
                run_id=run_id,
                boards=config.boards,
            )
            for sender in config.neighbours
        ]
        self.election = Election(
            ElectionConfig(config.period_ticks, config.watched_rounds, keeps_last=False),
            MaxConsensus(config),
            board=config.index,
        )
        self._links = range(len(config.neighbours))
        self._elected = False

    @property
    def round(self) -> int:
        """How many rounds of this epoch have been played."""
        return self.election.gossip.round

    def hear(self, link: int, payload: bytes) -> None:
        """Take a frame that arrived on the `link`-th of this board's links, whenever it did."""
        self.hearings[link].put(payload)

    def missing(self) -> int | None:
        """The first link whose frame of the tick before has yet to arrive, if any."""
        said_tick = self.next_tick - 1
        if said_tick < 0:
            return None
        there = _there(said_tick)
        for link, hearing in enumerate(self.hearings):
            if not hearing.has(said_tick, there):
                return link
        return None

    def tick(self) -> tuple[bytes, ...]:
        """Open an epoch or play a round; return a frame for each neighbour, in their order."""
        tick, config = self.next_tick, self.config
        self.next_tick = tick + 1
        epoch, round_ = divmod(tick, config.period_ticks)
        if round_ == 0:
            self.urgency = urgency(config.seed, config.index, epoch)
        known = self.election.gossip.best
        self.election.tick(tick, self.urgency, self._heard(tick), self._links)
        gossip = self.election.gossip
        if round_ == 0 or gossip.best != known:
            self.learned_round = round_
        if round_ == config.rounds:
            self._elected = gossip.best == Candidate(self.urgency, config.index)
        return self._say(tick, gossip)

    def ballot(self) -> Ballot | None:
        """What there is to say of the epoch, in the tick of its last watched round."""
        if self.next_tick % self.config.period_ticks != 0 or self.next_tick == 0:
            return None
        epoch, _, best = self.election.gossip
        return Ballot(epoch, self.urgency, best, self.learned_round, self._elected)

    def _heard(self, tick: int) -> list[HeardGossip]:
        if tick == 0:
            return []
        there = _there(tick - 1)
        return [
            HeardGossip(
                link, Gossip(frame.epoch, frame.round, Candidate(frame.urgency, frame.candidate))
            )
            for link, hearing in enumerate(self.hearings)
            for frame in hearing.take(tick, there)
        ]

    def _say(self, tick: int, gossip: Gossip) -> tuple[bytes, ...]:
        epoch, round_, (best_urgency, candidate) = gossip
        return tuple(
            encode(
                LinkFrame(
                    self.run_id,
                    INCARNATION,
                    tick,
                    hearing.newest_tick,
                    epoch,
                    round_,
                    best_urgency,
                    candidate,
                    NO_TICK,
                    *NO_BODY,
                )
            )
            for hearing in self.hearings
        )


def _there(said_tick: int) -> Neighbour:
    """Give the roster's entry for each neighbour: without a plant, all are always there."""
    return Neighbour(INCARNATION, said_tick, 1)
