"""Networks to measure consensus on: who hears whom, how wide it is, how long to watch it.

line      as the joints of a body: i hears i - 1 and i + 1
ring      the same, and the last hears the first
tree      binary: i hears (i - 1) // 2, and who has it there
random    connected: each board but the first has a link to a random one before it, and each
          one more to anybody; drawn from the seed
"""

from functools import cache
from math import exp, log

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from protocol.robot.chance import draw

GRAPHS = ("line", "ring", "tree", "random")
Near = tuple[tuple[int, ...], ...]
"""Of each board, the indices of the boards it hears, ascending."""
UNSEEN = 1e-6
"""Chance that agreement takes longer than an epoch is watched, at most."""
_BEFORE_ALL_TICKS = -1
_PARENT, _ANYBODY = range(2)


@cache
def neighbours(graph: str, boards: int, seed: int) -> Near:
    """Of each board, whom it hears. Links go both ways."""
    near: list[set[int]] = [set() for _ in range(boards)]
    for a, b in _links(graph, boards, seed):
        if a != b:
            near[a].add(b)
            near[b].add(a)
    return tuple(tuple(sorted(others)) for others in near)


@cache
def diameter(near: Near) -> int:
    """Hops between the two boards that are farthest apart, of a connected network."""
    hears = [(board, other) for board, others in enumerate(near) for other in others]
    rows, columns = zip(*hears, strict=True) if hears else ((), ())
    links = csr_array((np.ones(len(hears)), (rows, columns)), shape=(len(near), len(near)))
    hops = shortest_path(links, unweighted=True).max()
    assert np.isfinite(hops), "the network is connected"
    return int(hops)


def rounds_to_watch(boards: int, hops: int, loss: float) -> int:
    """How many rounds of an epoch to play, so that it almost never ends without agreement.

    Agreement is there when every board has heard of the maximum over `hops` links at most, each of
    which lets a frame through with 1 - loss per round. Chernoff's bound of the binomial tail, for
    all boards together.
    """
    rounds = max(1, hops)
    while loss > 0.0 and boards * _too_few(rounds, hops, 1.0 - loss) > UNSEEN:
        rounds += 1
    return rounds


def _too_few(rounds: int, hops: int, heard: float) -> float:
    """Bound the chance of less than `hops` successes in so many rounds."""
    share = hops / rounds
    if share >= heard:
        return 1.0
    apart = share * log(share / heard) + (1.0 - share) * log((1.0 - share) / (1.0 - heard))
    return exp(-rounds * apart)


def _links(graph: str, boards: int, seed: int) -> list[tuple[int, int]]:
    match graph:
        case "line":
            return [(board - 1, board) for board in range(1, boards)]
        case "ring":
            return [((board - 1) % boards, board) for board in range(boards)]
        case "tree":
            return [((board - 1) // 2, board) for board in range(1, boards)]
        case _:
            lower = [(_drawn(seed, board, _PARENT) % board, board) for board in range(1, boards)]
            return lower + [(_drawn(seed, b, _ANYBODY) % boards, b) for b in range(boards)]


def _drawn(seed: int, board: int, purpose: int) -> int:
    """Draw from what no link and no urgency is drawn from: a board's own, before all ticks."""
    return draw(seed, board, board, _BEFORE_ALL_TICKS, purpose)
