"""The line of three under loss: what theory says of its elections, beside what was measured.

Every frame arrives with p = 1 - q, whatever became of the others, and every board says again in
each round what it knows. Where the largest urgency is, and the second, decides how far news have to
go. With R = 2 a board enables itself unless it has heard of something larger.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import sqrt
from statistics import fmean
from typing import NamedTuple, TypeVar

from deploy.experiments.consensus.network import ConsensusCase, Epoch
from deploy.recording.trajectory import Floats
from module_agent.firmware.elector import urgency

Loss = TypeVar("Loss", float, Floats)
LINE_OF_THREE, R = ("line", 3), 2
PLACES = ("two ends", "end, middle", "middle, end")
"""Where the largest is, and the second."""
Z_95 = 1.96


class TheoryComparison(NamedTuple):
    """One loss and one place of the line of three at R = 2: measured, and in theory."""

    loss: float
    place: str
    epochs: int
    several_enabled: "MeasuredAndExpected"
    """Share of the epochs in which several boards were enabled after R rounds."""
    agreed: "MeasuredAndExpected"
    """Share of the epochs in which all boards knew the largest after R rounds."""
    mean_rounds: "MeasuredAndExpected"
    """Until all knew it."""


class MeasuredAndExpected(NamedTuple):
    """A number, and what it should be."""

    measured: float
    theory: float
    margin: float
    """Half width of the interval around theory in which 95 % of such measurements are."""


def several_enabled(loss: Loss, *, ends: bool) -> Loss:
    """Probability that several boards are enabled after 2 rounds.

    With `ends`, largest and second sit at the two ends; else one of them is in the middle.
    """
    return 1.0 - (1.0 - loss) ** 2 if ends else 1.0 - (1.0 - loss**2) ** 2


def agreed_within(rounds: int, loss: float, *, at_end: bool) -> float:
    """Probability that all know the largest after so many rounds."""
    if at_end:
        return 1.0 - loss**rounds - rounds * (1.0 - loss) * loss ** (rounds - 1)
    return (1.0 - loss**rounds) ** 2


def mean_rounds(loss: float, *, at_end: bool) -> float:
    """How many rounds it takes on average until all know the largest."""
    heard = 1.0 - loss
    return 2.0 / heard if at_end else 2.0 / heard - 1.0 / (1.0 - loss * loss)


def applies(case: ConsensusCase) -> bool:
    """Whether there is a closed form for all of this case."""
    return case[:2] == LINE_OF_THREE and case.rounds == R and case.loss > 0.0


def beside(case: ConsensusCase, epochs: Iterable[Epoch]) -> Iterator[TheoryComparison]:
    """Measured and theory for each place that came up."""
    found: dict[str, list[Epoch]] = {place: [] for place in PLACES}
    for epoch in epochs:
        found[_place(case, epoch.number)].append(epoch)
    for place, some in found.items():
        if some:
            yield _beside(case.loss, place, some)


def _place(case: ConsensusCase, number: int) -> str:
    """Where the largest urgency of an epoch is, and the second; ties go to the higher board."""
    second, largest = sorted(
        (urgency(case.seed, board, number), board) for board in range(case.boards)
    )[-2:]
    if 1 not in (largest[1], second[1]):
        return PLACES[0]
    return PLACES[2] if largest[1] == 1 else PLACES[1]


def _beside(loss: float, place: str, epochs: Sequence[Epoch]) -> TheoryComparison:
    at_end = place != PLACES[2]
    rounds = [epoch.agreed_round for epoch in epochs if epoch.agreed_round is not None]
    deviation = sqrt(_variance(loss, at_end=at_end))
    return TheoryComparison(
        loss,
        place,
        len(epochs),
        _share(
            [epoch.enabled > 1 for epoch in epochs], several_enabled(loss, ends=place == PLACES[0])
        ),
        _share(
            [epoch.agreed_round in (1, R) for epoch in epochs],
            agreed_within(R, loss, at_end=at_end),
        ),
        MeasuredAndExpected(
            fmean(rounds),
            mean_rounds(loss, at_end=at_end),
            Z_95 * deviation / sqrt(len(rounds)),
        ),
    )


def _share(true: Sequence[bool], theory: float) -> MeasuredAndExpected:
    margin = Z_95 * sqrt(theory * (1.0 - theory) / len(true))
    return MeasuredAndExpected(sum(true) / len(true), theory, margin)


def _variance(loss: float, *, at_end: bool) -> float:
    """Of the rounds until all know the largest: of two hops in turn, or of the later of two."""
    heard = 1.0 - loss
    if at_end:
        return 2.0 * loss / heard**2
    both = 1.0 - loss**2
    square = 2.0 * (1.0 + loss) / heard**2 - (1.0 + loss**2) / both**2
    return square - mean_rounds(loss, at_end=False) ** 2
