"""The twin of a network that does nothing but elect: its epochs, played in one process.

Rule 1: the boards' own code elects and loses frames (`consensus`, `link_model`); what
        is here only carries what they say, and looks at what they know.
Rule 2: an epoch follows from the case and its number. It does not matter who plays it, or where:
        the twin and real processes count the same rounds.
Rule 3: to hear what is no larger than what one knows changes nothing. So only links whose sender
        knows more than their receiver are played, and thousands of boards take seconds.

A round is a tick. Rounds to agreement are counted as long as it takes (`watched_rounds`); who would
be enabled is asked after R rounds, when the boards latch.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

from deploy.experiments.consensus.graphs import Near, neighbours
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Candidate, Round
from module_agent.firmware.elector import urgency
from module_agent.firmware.link_model import LinkModel
from protocol.robot.events import PERFECT

PIECE_BOARDS = 20_000
"""A piece of work has so many epochs times boards: well under a second."""


class ConsensusCase(NamedTuple):
    """One network to measure."""

    graph: str
    boards: int
    loss: float
    rounds: int
    """R."""
    epochs: int
    seed: int
    diameter: int
    watched_rounds: int

    @property
    def period_ticks(self) -> int:
        """From the start of one epoch to that of the next."""
        return self.watched_rounds + 1

    @property
    def near(self) -> Near:
        """Of each board, whom it hears."""
        return neighbours(self.graph, self.boards, self.seed)


class Epoch(NamedTuple):
    """What came of one epoch."""

    number: int
    agreed_round: int | None
    """After how many rounds all boards knew the maximum; None: not while it was watched."""
    enabled: int
    """Boards that took themselves for the maximum after R rounds."""
    wall_ms: float | None = None
    """Processes: from the first board's start of the epoch to the last one's knowing. Not of the
    first epoch."""


class EpochBatch(NamedTuple):
    """Some epochs of a case."""

    case: ConsensusCase
    first: int
    epochs: int


class BatchResult(NamedTuple):
    """What came of a piece."""

    case: ConsensusCase
    epochs: list[Epoch]


def pieces(cases: Iterable[ConsensusCase]) -> list[EpochBatch]:
    """Cut cases into pieces of work that take about as long as each other."""
    return [
        EpochBatch(case, first, min(size, case.epochs - first))
        for case in cases
        for size in [max(1, PIECE_BOARDS // case.boards)]
        for first in range(0, case.epochs, size)
    ]


@dataclass(frozen=True, slots=True)
class BoardIndex:
    """All that an election needs to know of its board."""

    index: int


class DirectedLink(NamedTuple):
    """A directed link and the boards at its ends."""

    sender: MaxConsensus
    receiver: MaxConsensus
    model: LinkModel


class ConsensusNetwork:
    """All boards of a case in one process."""

    def __init__(self, case: ConsensusCase) -> None:
        self.case = case
        self.boards = [MaxConsensus(BoardIndex(board)) for board in range(case.boards)]
        standing = PERFECT._replace(loss=case.loss)
        self.from_board = [
            [
                DirectedLink(
                    board,
                    self.boards[other],
                    LinkModel(
                        seed=case.seed, sender=board.board, receiver=other, standing=standing
                    ),
                )
                for other in others
            ]
            for board, others in zip(self.boards, case.near, strict=True)
        ]

    def play(self, number: int) -> Epoch:
        """Play one epoch until all agree and R rounds are over, or for as long as is watched."""
        case, first_tick = self.case, number * self.case.period_ticks
        for board in self.boards:
            board.vote(_round_of(first_tick, 0, urgency(case.seed, board.board, number), ()))
        own = [board.best for board in self.boards]
        best = max(own)
        knowing, agreed_round, enabled = 1, None, 0
        news = _news(chain.from_iterable(self.from_board))
        for round_ in range(1, case.watched_rounds + 1):
            moved = _round(news, first_tick, round_)
            knowing += sum(board.best == best for board in moved)
            if agreed_round is None and knowing == case.boards:
                agreed_round = round_
            if round_ == case.rounds:
                enabled = sum(
                    board.best == mine for board, mine in zip(self.boards, own, strict=True)
                )
            if agreed_round is not None and round_ >= case.rounds:
                break
            news = _news(chain(news, *(self.from_board[board.board] for board in moved)))
        return Epoch(number, agreed_round, enabled)


def play(piece: EpochBatch) -> BatchResult:
    """Play some epochs of a case in the twin."""
    network = ConsensusNetwork(piece.case)
    numbers = range(piece.first, piece.first + piece.epochs)
    return BatchResult(piece.case, [network.play(number) for number in numbers])


def _news(links: Iterable[DirectedLink]) -> set[DirectedLink]:
    """Links on which there is something to hear."""
    return {link for link in links if link.sender.best > link.receiver.best}


def _round(news: Iterable[DirectedLink], first_tick: int, number: int) -> set[MaxConsensus]:
    """All say what they know, then all hear; return the boards that know more now."""
    heard: defaultdict[MaxConsensus, list[Candidate]] = defaultdict(list)
    for link in news:
        if link.model.fate(first_tick + number - 1).late_ticks:
            heard[link.receiver].append(link.sender.best)
    for receiver, candidates in heard.items():
        receiver.vote(_round_of(first_tick + number, number, 0.0, candidates))
    return set(heard)


def _round_of(tick: int, number: int, own: float, heard: Sequence[Candidate]) -> Round:
    return Round(
        tick, 0, number, last=False, urgency=own, heard=heard, complete=True, enabled=False
    )
