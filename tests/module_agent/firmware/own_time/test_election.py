"""Elections without a barrier: rounds by time, boards that sleep, are late, or come in between."""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

import pytest

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import (
    Candidate,
    ElectionRule,
    FaultError,
    Round,
    Vote,
)
from module_agent.firmware.election import Election, Gossip, HeardGossip
from module_agent.firmware.own_time.translator import OwnTime
from protocol.robot.cadence import Cadence
from protocol.robot.states import FaultCode
from protocol.wire.trace import Mark
from tests.module_agent.robot import config

PERIOD, ROUNDS = 100, 2
"""In plant ticks, and rounds of 4 ticks."""


def own_time(ticks_per_period: int, *, period: int = PERIOD, keeps_last: bool = False) -> OwnTime:
    cadence = Cadence((ticks_per_period,) * 3, 4, 0, 250, 40, catches_up=False)
    elects = ElectionConfig(period, ROUNDS, keeps_last=keeps_last)
    return OwnTime(config(0, cadence=cadence, election=elects))


class Timed:
    """An election that is told the slots of its board, as a board tells it."""

    def __init__(self, rule: ElectionRule, own: OwnTime, *, board: int) -> None:
        assert own.config.election is not None
        self.own_time = own
        self.election = Election(own.config.election, rule, board=board, listens_always=True)

    def tick(
        self, slot: int, urgency: float, heard: list[HeardGossip], rostered: Sequence[int]
    ) -> None:
        self.election.tick(self.own_time.round(slot), urgency, heard, rostered)


def election(board: int, *, ticks_per_period: int = 2, keeps_last: bool = False) -> Timed:
    own = own_time(ticks_per_period, keeps_last=keeps_last)
    return Timed(MaxConsensus(Only(board)), own, board=board)


@dataclass
class Only:
    """All that the rule asks of a board."""

    index: int


class Line:
    """Boards in a line, each at its own rate and phase; frames take up to `latency` ticks."""

    def __init__(self, rates: tuple[int, ...], *, latency: float, seed: int) -> None:
        self.random = Random(seed)
        self.latency = latency
        self.rates = rates
        self.boards = [election(i, ticks_per_period=m) for i, m in enumerate(rates)]
        self.phases = [self.random.uniform(0.0, 0.99) * m for m in rates]
        self.urgencies = [0.0] * len(rates)
        self.asleep: dict[int, range] = {}
        self.decided: dict[tuple[int, int], bool] = {}
        self.marks: list[list[Mark]] = [[] for _ in rates]
        self._under_way: list[tuple[float, int, int, Gossip]] = []

    def run(self, ticks: int) -> None:
        turns = sorted(
            (slot * m + phase, board, slot)
            for board, (m, phase) in enumerate(zip(self.rates, self.phases, strict=True))
            for slot in range(ticks // m)
        )
        for now, board, slot in turns:
            if int(now) not in self.asleep.get(board, ()):
                self._play(now, board, slot)

    def _play(self, now: float, board: int, slot: int) -> None:
        mine = [entry for entry in self._under_way if entry[1] == board and entry[0] <= now]
        self._under_way = [entry for entry in self._under_way if entry not in mine]
        near = [other for other in (board - 1, board + 1) if 0 <= other < len(self.boards)]
        heard = [HeardGossip(near.index(sender), gossip) for _, _, sender, gossip in sorted(mine)]
        one = self.boards[board]
        if slot * self.rates[board] % PERIOD < self.rates[board]:
            self.urgencies[board] = self.random.random()
        one.tick(slot, self.urgencies[board], heard, range(len(near)))
        self.marks[board].append(one.election.marks)
        if one.election.marks & Mark.LATCHED:
            self.decided[one.election.gossip.epoch, board] = one.election.enabled
        for other in near:
            arrives = now + self.random.uniform(0.1, self.latency)
            self._under_way.append((arrives, other, board, one.election.gossip))


@pytest.mark.parametrize("rates", [(2, 2, 2), (1, 2, 1), (2, 1, 2), (1, 1, 2)])
@pytest.mark.parametrize("seed", range(20))
def test_exactly_one_is_elected_whatever_the_phases(rates: tuple[int, ...], seed: int) -> None:
    """Periods of up to 2 ticks and a latency of less than one fit into rounds of 4."""
    line = Line(rates, latency=0.9, seed=seed)
    line.run(10 * PERIOD)
    for epoch in range(10):
        assert sum(line.decided[epoch, board] for board in range(3)) == 1
    assert [one.election.incomplete_epochs for one in line.boards] == [0, 0, 0]


def test_a_board_that_comes_late_passes_on_and_does_not_stand() -> None:
    line = Line((2, 2, 2), latency=0.9, seed=1)
    line.asleep[1] = range(98, 104)  # The middle one wakes up in round 1.
    line.run(2 * PERIOD)
    assert not line.decided[1, 1]
    assert Mark.MISSED_EPOCH in line.marks[1]
    assert Mark.BEGAN not in line.marks[1][40:]


def test_a_board_that_sleeps_through_an_epoch_stays_as_it_was() -> None:
    line = Line((2, 2, 2), latency=0.9, seed=1)
    line.asleep[2] = range(95, 130)
    line.run(2 * PERIOD)
    assert (1, 2) not in line.decided
    assert line.boards[2].election.enabled == line.decided[0, 2]
    assert line.marks[2].count(Mark.MISSED_EPOCH) == 1


def test_a_round_that_was_slept_through_makes_the_epoch_incomplete() -> None:
    line = Line((2, 2, 2), latency=0.9, seed=1)
    line.asleep[0] = range(102, 107)  # Round 1 of epoch 1.
    line.run(2 * PERIOD)
    assert line.boards[0].election.incomplete_epochs == 1
    assert (1, 0) in line.decided, "it decides with what it knows"


def test_it_keeps_what_it_was_if_told_to() -> None:
    one = election(0, keeps_last=True)
    for slot in range(50):
        one.tick(slot, 0.1, [], [0])
    assert one.election.enabled, "nothing was heard of the neighbour, so it is as at first"
    assert one.election.incomplete_epochs == 1


@pytest.mark.parametrize("first_slot", [2, 3, 20, 49])
def test_a_board_that_joins_in_the_middle_waits_for_the_next_epoch(first_slot: int) -> None:
    one = election(0)
    one.election.enabled = False
    marks = []
    for slot in range(first_slot, 60):
        one.tick(slot, 0.1, [], [])
        marks.append((slot, one.election.marks))
    assert [slot for slot, mark in marks if mark] == [50, 54]
    assert one.election.enabled


def test_the_last_round_takes_what_is_left_of_the_period() -> None:
    """A period of 102 ticks has 25 rounds of 4; the rest belongs to the last."""
    one = Timed(MaxConsensus(Only(0)), own_time(2, period=102), board=0)
    began = []
    for slot in range(200):
        one.tick(slot, 0.1, [], [])
        if one.election.marks & Mark.BEGAN:
            began.append(slot * 2)
    assert began == [0, 102, 204, 306]


def test_gossip_of_another_epoch_counts_for_nothing() -> None:
    one = election(0)
    for slot in range(5):
        one.tick(slot, 0.1, [HeardGossip(0, Gossip(7, 1, Candidate(9.0, 1)))], [0])
    assert one.election.enabled
    assert one.election.incomplete_epochs == 1


def test_a_rule_that_fails_in_a_round_slept_through_costs_the_others_nothing() -> None:
    """The round is played again by the rule that takes its place, and is not counted twice."""

    class Failing:
        """Fails once, when it is asked for round 1."""

        def vote(self, now: Round) -> Vote:
            if now.number == 1:
                raise FaultError(FaultCode.ELECTION_RAISED, summary="no", trace="no")
            return Vote(Candidate(now.urgency, 0), enabled=True)

    one = Timed(Failing(), own_time(2), board=0)
    one.tick(0, 0.5, [], [0])
    said = [HeardGossip(0, Gossip(0, 1, Candidate(0.9, 1)))]
    with pytest.raises(FaultError):
        one.tick(4, 0.5, said, [0])  # In round 2; round 1 was slept through.
    one.election.relay(Only(0))
    one.tick(4, 0.0, said, [0])
    assert one.election.gossip == (0, 2, Candidate(0.9, 1))
    assert one.election.marks & Mark.LATCHED
    assert not one.election.enabled
