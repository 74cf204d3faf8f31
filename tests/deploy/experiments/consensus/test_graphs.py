"""The networks that consensus is measured on, against another library's graph algorithms."""

import numpy as np
import pytest
from scipy.sparse.csgraph import shortest_path
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


def hops(near: Near) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Between any two boards."""
    linked = np.zeros((len(near), len(near)))
    for board, others in enumerate(near):
        linked[board, list(others)] = 1.0
    found: np.ndarray[tuple[int, int], np.dtype[np.float64]] = shortest_path(
        linked, unweighted=True
    )
    return found


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("boards", SIZES)
def test_links_go_both_ways_and_reach_everybody(graph: str, boards: int) -> None:
    near = neighbours(graph, boards, 3)
    assert len(near) == boards
    for board, others in enumerate(near):
        assert board not in others
        assert list(others) == sorted(set(others))
        assert all(board in near[other] for other in others)
    assert np.isfinite(hops(near)).all()


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("boards", SIZES)
def test_the_diameter_is_the_longest_of_all_shortest_ways(graph: str, boards: int) -> None:
    near = neighbours(graph, boards, 3)
    assert diameter(near) == hops(near).max()


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
