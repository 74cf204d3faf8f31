"""The networks that consensus is measured on: their links, their width, how long to watch them."""

import numpy as np
import pytest
from scipy.stats import binom

from deploy.experiments.consensus.graphs import (
    GRAPHS,
    UNSEEN,
    Near,
    diameter,
    neighbours,
    rounds_to_watch,
)

SIZES = (2, 3, 4, 7, 20, 61)


def rounds_until_everybody_knows(near: Near) -> int:
    """Flooding, as the boards do it: in each round every board takes over what its neighbours know.

    Ends with what is known after so many rounds as there are boards, at the latest.
    """
    known = [{board} for board in range(len(near))]
    for rounds in range(len(near)):
        if all(len(heard) == len(near) for heard in known):
            return rounds
        known = [known[board].union(*(known[n] for n in near[board])) for board in range(len(near))]
    raise AssertionError("some board is never heard of")


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("boards", SIZES)
def test_links_go_both_ways_and_reach_everybody(graph: str, boards: int) -> None:
    near = neighbours(graph, boards, 3)
    assert len(near) == boards
    for board, others in enumerate(near):
        assert board not in others
        assert list(others) == sorted(set(others))
        assert all(board in near[other] for other in others)
    assert rounds_until_everybody_knows(near) < boards


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("boards", SIZES)
def test_after_as_many_rounds_as_the_diameter_everybody_has_heard_of_everybody(
    graph: str, boards: int
) -> None:
    near = neighbours(graph, boards, 3)
    assert diameter(near) == rounds_until_everybody_knows(near)


def test_they_have_the_links_that_they_are_named_after() -> None:
    assert neighbours("line", 4, 1) == ((1,), (0, 2), (1, 3), (2,))
    assert neighbours("ring", 4, 1) == ((1, 3), (0, 2), (1, 3), (0, 2))
    assert neighbours("tree", 6, 1) == ((1, 2), (0, 3, 4), (0, 5), (1,), (1,), (2,))


def test_only_the_random_one_depends_on_the_seed() -> None:
    for graph in GRAPHS:
        drawn = {neighbours(graph, 30, seed) for seed in range(5)}
        assert len(drawn) == (5 if graph == "random" else 1)


def test_a_random_network_of_n_has_about_two_links_a_board() -> None:
    links = [sum(map(len, neighbours("random", 50, seed))) / 2 for seed in range(40)]
    assert all(49 <= count <= 99 for count in links)
    assert 90 < np.mean(links) < 99  # Some are drawn twice, or from a board to itself.


@pytest.mark.parametrize("boards", [2, 3, 50, 1000])
@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5, 0.9])
def test_an_epoch_is_watched_until_agreement_is_all_but_certain(boards: int, loss: float) -> None:
    """Never less than the hops; a binomial tail for each board, by another library."""
    for far in (1, boards // 2, boards - 1):
        rounds = rounds_to_watch(boards, far, loss)
        assert rounds >= max(1, far)
        assert boards * binom.cdf(far - 1, rounds, 1.0 - loss) <= UNSEEN
    assert rounds_to_watch(boards, boards - 1, 0.0) == boards - 1
