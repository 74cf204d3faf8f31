"""Measuring consensus by itself: boards without a body, over sizes, graphs and losses.

Rule: a row of the file is a case, and says all that it takes to play it again, to the same rounds.
"""

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from math import ceil
from pathlib import Path
from typing import NamedTuple

from deploy.experiments.consensus.graphs import GRAPHS, diameter, neighbours, rounds_to_watch
from deploy.experiments.consensus.network import BatchResult, ConsensusCase, Epoch
from protocol.wire.frames import TICK_MAX

BOARDS_MIN, BOARDS_MAX = 2, 10_000
LOSS_MAX = 0.9
NEVER = "never"
CSV = "consensus.csv"


class Quantiles(NamedTuple):
    """Of a number over epochs, by nearest rank; None: never, or not measured."""

    p50: float | None
    p90: float | None
    p99: float | None
    max: float | None


class ConsensusRow(NamedTuple):
    """What came of a case: a row of the CSV file."""

    graph: str
    boards: int
    links: int
    """Two-way."""
    diameter: int
    loss: float
    rounds: int
    """R."""
    seed: int
    epochs: int
    """Those that were played."""
    agreement_rounds: Quantiles
    """Rounds until every board knew the maximum."""
    agreed_in_diameter: float
    """Share of the epochs in which that was not later than without loss."""
    agreed_in_rounds: float
    """Share of the epochs in which it was not later than R."""
    enabled_0: int
    """Epochs after whose R rounds no board would be enabled."""
    enabled_1: int
    enabled_2_or_more: int
    wall_ms: Quantiles
    """Processes: wall time until every board knew the maximum."""
    rounds_to_agreement: dict[str, int]
    """How many epochs took so many rounds."""


def grid(
    *,
    boards: Sequence[int],
    graphs: Sequence[str],
    losses: Sequence[float],
    rounds: int | None,
    epochs: int,
    seed: int,
) -> list[ConsensusCase]:
    """Every case, R being the diameter unless given. Raises ValueError for what cannot be."""
    return [
        _case(graph, size, loss, rounds, epochs, seed)
        for graph, size, loss in product(graphs, boards, losses)
    ]


def rows(cases: Iterable[ConsensusCase], played: Iterable[BatchResult]) -> Iterator[ConsensusRow]:
    """Sum up each case of which there is an epoch, in the order of the cases."""
    for case, epochs in by_case(cases, played).items():
        yield _row(case, epochs)


def by_case(
    cases: Iterable[ConsensusCase], played: Iterable[BatchResult]
) -> dict[ConsensusCase, list[Epoch]]:
    """The epochs of each case that has any, in order."""
    epochs: dict[ConsensusCase, list[Epoch]] = {case: [] for case in cases}
    for case, some in played:
        epochs[case].extend(some)
    return {case: sorted(found) for case, found in epochs.items() if found}


def spread(values: Iterable[float | None]) -> Quantiles:
    """Nearest-rank percentiles; None counts as later than anything."""
    ordered = sorted(values, key=lambda value: (value is None, value))
    if not ordered:
        return Quantiles(None, None, None, None)
    return Quantiles(*(ordered[ceil(share * len(ordered)) - 1] for share in (0.5, 0.9, 0.99, 1.0)))


def write_csv(found: Sequence[ConsensusRow], path: Path) -> None:
    """Write one line per case. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        flat = [_flat(row) for row in found]
        writer = csv.DictWriter(file, flat[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)


def _case(
    graph: str, boards: int, loss: float, rounds: int | None, epochs: int, seed: int
) -> ConsensusCase:
    if graph not in GRAPHS:
        raise ValueError(f"there is no graph {graph!r}; there are {', '.join(GRAPHS)}")
    if not BOARDS_MIN <= boards <= BOARDS_MAX:
        raise ValueError(f"{boards} boards: from {BOARDS_MIN} to {BOARDS_MAX} can be measured")
    if not 0.0 <= loss <= LOSS_MAX:
        raise ValueError(f"a loss of {loss:g}: from 0 to {LOSS_MAX:g} can be measured")
    hops = diameter(neighbours(graph, boards, seed))
    rounds = rounds or hops
    watched = max(rounds, rounds_to_watch(boards, hops, loss))
    if epochs * (watched + 1) > TICK_MAX:
        raise ValueError(f"{epochs} epochs of {watched + 1} ticks: ticks are numbers of 32 bits")
    return ConsensusCase(graph, boards, loss, rounds, epochs, seed, hops, watched)


def _row(case: ConsensusCase, epochs: Sequence[Epoch]) -> ConsensusRow:
    agreed = [epoch.agreed_round for epoch in epochs]
    counted = Counter(agreed)
    enabled = Counter(min(epoch.enabled, 2) for epoch in epochs)
    by_round = {str(n): counted[n] for n in sorted(n for n in counted if n is not None)}
    return ConsensusRow(
        case.graph,
        case.boards,
        sum(map(len, case.near)) // 2,
        case.diameter,
        case.loss,
        case.rounds,
        case.seed,
        len(epochs),
        spread(agreed),
        sum(n is not None and n <= case.diameter for n in agreed) / len(epochs),
        sum(n is not None and n <= case.rounds for n in agreed) / len(epochs),
        enabled[0],
        enabled[1],
        enabled[2],
        spread([epoch.wall_ms for epoch in epochs if epoch.wall_ms is not None]),
        {**by_round, NEVER: counted[None]},
    )


def _flat(row: ConsensusRow) -> dict[str, object]:
    """A row for a file of columns: spreads spread out, and without the histogram."""
    flat: dict[str, object] = {}
    for name, value in row._asdict().items():
        if isinstance(value, Quantiles):
            flat |= {f"{name}_{share}": number for share, number in value._asdict().items()}
        elif name != "rounds_to_agreement":
            flat[name] = value
    return flat
