"""Max-consensus on any network, without and with loss, against its theory."""

import random
from collections.abc import Sequence
from math import sqrt
from statistics import fmean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.controller import Candidate
from module_agent.firmware.election import Gossip
from protocol.wire.frames import NO_EPOCH
from tests.module_agent.player import Player

pytestmark = pytest.mark.sampling

LAW = settings(max_examples=150, deadline=None, derandomize=True)
Z_99_9 = 3.29  # Half width of a 99.9 % interval, in standard deviations.

Graph = list[set[int]]
"""Neighbours of each board."""

URGENCIES = st.floats(0.0, 10.0) | st.sampled_from([0.0, 0.5, 1.0])
"""With ties often."""


def _graph(boards: int, edges: Sequence[tuple[int, int]]) -> Graph:
    graph: Graph = [set() for _ in range(boards)]
    for a, b in edges:
        graph[a].add(b)
        graph[b].add(a)
    return graph


def line(boards: int) -> Graph:
    return _graph(boards, [(i, i + 1) for i in range(boards - 1)])


def ring(boards: int) -> Graph:
    return _graph(boards, [(i, (i + 1) % boards) for i in range(boards)])


@st.composite
def trees(draw: st.DrawFn) -> Graph:
    boards = draw(st.integers(1, 9))
    return _graph(boards, [(draw(st.integers(0, i - 1)), i) for i in range(1, boards)])


@st.composite
def connected(draw: st.DrawFn) -> Graph:
    graph = draw(trees())
    ids = st.integers(0, len(graph) - 1)
    for a, b in draw(st.lists(st.tuples(ids, ids), max_size=8)):
        if a != b:
            graph[a].add(b)
            graph[b].add(a)
    return graph


GRAPHS = st.one_of(st.integers(1, 9).map(line), st.integers(3, 9).map(ring), trees(), connected())


def diameter(graph: Graph) -> int:
    longest = 0
    for start in range(len(graph)):
        seen, front, hops = {start}, {start}, 0
        while len(seen) < len(graph):
            front = {b for a in front for b in graph[a]} - seen
            seen |= front
            hops += 1
        longest = max(longest, hops)
    return longest


def begin(urgencies: Sequence[float], rounds: int) -> list[Player]:
    boards = [
        Player(board=i, period_ticks=rounds + 1, rounds=rounds) for i in range(len(urgencies))
    ]
    for board, urgency in zip(boards, urgencies, strict=True):
        board.begin(0, urgency)
    return boards


def play(boards: list[Player], graph: Graph) -> list[bool]:
    """One round: all say, then all hear. Returns who shall latch."""
    said = [board.gossip for board in boards]
    for board, near in zip(boards, graph, strict=True):
        for other in near:
            board.hear(said[other])
    return [board.advance() for board in boards]


@st.composite
def cases(draw: st.DrawFn) -> tuple[Graph, list[float]]:
    graph = draw(GRAPHS)
    size = len(graph)
    return graph, draw(st.lists(URGENCIES, min_size=size, max_size=size))


@LAW
@given(cases())
def test_all_agree_after_as_many_rounds_as_the_network_is_wide(
    case: tuple[Graph, list[float]],
) -> None:
    """Equation achievedMaxCons; every board latches in the same, last, round."""
    graph, urgencies = case
    rounds = max(1, diameter(graph))
    boards = begin(urgencies, rounds)
    latched = [play(boards, graph) for _ in range(rounds)]
    best = max(Candidate(w, i) for i, w in enumerate(urgencies))
    assert [board.best for board in boards] == [best] * len(boards)
    assert [all(round_) for round_ in latched] == [False] * (rounds - 1) + [True]
    assert [any(round_) for round_ in latched] == [False] * (rounds - 1) + [True]


@LAW
@given(cases())
def test_exactly_one_is_elected_ties_included(case: tuple[Graph, list[float]]) -> None:
    """Equation computeY, without the paper's assumption 2 (that urgencies differ)."""
    graph, urgencies = case
    rounds = max(1, diameter(graph))
    boards = begin(urgencies, rounds)
    for _ in range(rounds):
        play(boards, graph)
    assert [board.elected for board in boards].count(True) == 1
    assert urgencies[[board.elected for board in boards].index(True)] == max(urgencies)


@pytest.mark.parametrize("size", range(2, 9))
def test_one_round_less_than_the_width_is_not_enough(size: int) -> None:
    """The bound is tight: from one end of a line to the other."""
    rounds = size - 1
    boards = begin([1.0] + [0.0] * rounds, rounds)
    for _ in range(rounds - 1):
        play(boards, line(size))
    assert boards[-1].best != Candidate(1.0, 0)
    play(boards, line(size))
    assert boards[-1].best == Candidate(1.0, 0)


def test_from_the_middle_of_three_one_round_is_enough() -> None:
    boards = begin([0.1, 0.9, 0.2], 2)
    play(boards, line(3))
    assert {board.best for board in boards} == {Candidate(0.9, 1)}


@LAW
@given(
    st.lists(st.tuples(URGENCIES, st.integers(0, 5)), max_size=8),
    st.lists(st.integers(0, 3), min_size=16, max_size=16),
    st.randoms(use_true_random=False),
)
def test_order_repetition_and_delay_of_gossip_do_not_change_the_maximum(
    candidates: list[tuple[float, int]], delays: list[int], chance: random.Random
) -> None:
    """Maximum is commutative, associative and idempotent."""
    in_order, shuffled = begin([0.3, 0.3], 5)
    gossips = [Gossip(0, 0, Candidate(*candidate)) for candidate in candidates]
    twice = [*gossips, *gossips]
    chance.shuffle(twice)
    for round_ in range(5):
        if round_ == 0:
            for gossip in gossips:
                in_order.hear(gossip)
        for gossip, delay in zip(twice, delays, strict=False):
            if delay == round_:
                shuffled.hear(gossip)
        in_order.advance()
        shuffled.advance()
    own = {in_order: Candidate(0.3, 0), shuffled: Candidate(0.3, 1)}
    for board in (in_order, shuffled):
        assert board.best == max([own[board], *(gossip.best for gossip in gossips)])


@LAW
@given(cases(), st.randoms(use_true_random=False))
def test_late_gossip_only_delays_agreement(
    case: tuple[Graph, list[float]], chance: random.Random
) -> None:
    """Every frame up to three rounds late: agreement after at most four times as many rounds."""
    graph, urgencies = case
    rounds = 4 * max(1, diameter(graph))
    boards = begin(urgencies, rounds)
    under_way: list[tuple[int, int, Gossip]] = []
    for round_ in range(rounds):
        for board, near in zip(boards, graph, strict=True):
            under_way += [(round_ + chance.randint(0, 3), b, board.gossip) for b in near]
        for due, receiver, gossip in under_way:
            if due == round_:
                boards[receiver].hear(gossip)
        for board in boards:
            board.advance()
    assert sum(board.elected for board in boards) == 1


@LAW
@given(st.integers(-3, 6).filter(lambda epoch: epoch != 2), URGENCIES)
def test_gossip_of_another_epoch_never_enters(epoch: int, urgency: float) -> None:
    board = Player(board=0, period_ticks=10, rounds=3)
    board.begin(20, 0.1)
    for _ in range(3):
        board.hear(Gossip(epoch, 1, Candidate(100.0 + urgency, 1)))
        board.advance()
    assert board.elected
    assert board.gossip == Gossip(2, 3, Candidate(0.1, 0))


def test_nothing_enters_before_the_first_epoch_or_after_the_last_round() -> None:
    board = Player(board=0, period_ticks=10, rounds=2)
    board.hear(Gossip(NO_EPOCH, 0, Candidate(9.0, 1)))
    assert not board.advance()
    assert board.best == Candidate(0.0, 0)
    board.begin(0, 0.5)
    assert [board.advance(), board.advance(), board.advance()] == [False, True, False]
    board.hear(Gossip(0, 2, Candidate(9.0, 1)))
    assert not board.advance()
    assert board.best == Candidate(0.5, 0)


def test_an_epoch_knows_nothing_of_the_one_before() -> None:
    board = Player(board=0, period_ticks=10, rounds=1)
    board.begin(0, 0.1)
    board.hear(Gossip(0, 0, Candidate(5.0, 1)))
    assert board.advance()
    assert not board.elected
    board.begin(10, 0.1)
    assert board.advance()
    assert board.elected


def test_a_nan_never_displaces_a_number() -> None:
    board = Player(board=0, period_ticks=10, rounds=1)
    board.begin(0, 0.1)
    board.hear(Gossip(0, 0, Candidate(float("nan"), 1)))
    board.advance()
    assert board.best == Candidate(0.1, 0)


# --- Bernoulli loss on a line of three: closed forms ---------------------------------------------

TRIALS = 3000
WATCHED_ROUNDS_MAX = 60
ENDS, MIDDLE = [0.9, 0.5, 0.1], [0.5, 0.9, 0.1]


def _lossy_round(boards: list[Player], heard: float, chance: random.Random) -> None:
    said = [board.gossip for board in boards]
    for receiver, sender in ((0, 1), (1, 0), (1, 2), (2, 1)):
        if chance.random() < heard:
            boards[receiver].hear(said[sender])
    for board in boards:
        board.advance()


def _rounds_to_agreement(urgencies: list[float], heard: float, chance: random.Random) -> int:
    boards = begin(urgencies, WATCHED_ROUNDS_MAX)
    best = max(board.best for board in boards)
    for round_ in range(1, WATCHED_ROUNDS_MAX + 1):
        _lossy_round(boards, heard, chance)
        if all(board.best == best for board in boards):
            return round_
    raise AssertionError(f"no agreement within {WATCHED_ROUNDS_MAX} rounds")


def _assert_share(hits: int, expected: float) -> None:
    """A share of `TRIALS` is within the 99.9 % interval of a probability."""
    margin = Z_99_9 * sqrt(expected * (1.0 - expected) / TRIALS) + 0.5 / TRIALS
    assert abs(hits / TRIALS - expected) <= margin


@pytest.mark.parametrize("p", [0.9, 0.8, 0.5])
@pytest.mark.parametrize("at_end", [True, False], ids=["end", "middle"])
def test_rounds_to_agreement_under_loss_follow_theory(p: float, at_end: bool) -> None:
    """The maximum at an end, or in the middle; p is the chance of a frame to be heard."""
    chance, q = random.Random(f"agreement {p} {at_end}"), 1.0 - p
    urgencies = ENDS if at_end else MIDDLE
    rounds = [_rounds_to_agreement(urgencies, p, chance) for _ in range(TRIALS)]
    for k in range(1, 7):
        expected = 1.0 - q**k - k * p * q ** (k - 1) if at_end else (1.0 - q**k) ** 2
        _assert_share(sum(t <= k for t in rounds), expected)
    mean = 2.0 / p if at_end else 2.0 / p - 1.0 / (1.0 - q * q)
    deviation = sqrt(fmean((t - mean) ** 2 for t in rounds))
    assert abs(fmean(rounds) - mean) <= Z_99_9 * deviation / sqrt(TRIALS)


@pytest.mark.parametrize("p", [0.9, 0.8, 0.5])
@pytest.mark.parametrize(
    ("urgencies", "runner_up_at_other_end"),
    [(MIDDLE, False), (ENDS, False), ([0.9, 0.1, 0.5], True)],
    ids=["middle", "end", "two-ends"],
)
def test_several_are_enabled_as_often_as_theory_says_but_never_none(
    p: float, urgencies: list[float], runner_up_at_other_end: bool
) -> None:
    """Exactly two rounds, each board enabling itself unless it heard of something larger."""
    chance, q, several = random.Random(f"two rounds {p} {urgencies}"), 1.0 - p, 0
    winner = urgencies.index(max(urgencies))
    for _ in range(TRIALS):
        boards = begin(urgencies, 2)
        _lossy_round(boards, p, chance)
        _lossy_round(boards, p, chance)
        assert boards[winner].elected
        several += sum(board.elected for board in boards) > 1
    _assert_share(several, 1.0 - p * p if runner_up_at_other_end else 1.0 - (1.0 - q * q) ** 2)
