"""What a board counts since its admission, one number for each of `protocol.states.COUNTERS`."""

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from module_agent.election import Election
from module_agent.hearing import Hearing
from module_agent.sensing import Sensing
from protocol.frames import Reason
from protocol.states import COUNTERS, State


class Counted(Protocol):
    """The parts of a `Board` that count."""

    state_ticks: list[int]
    refused: Counter[Reason]
    hearings: list[Hearing]
    sensing: Sensing
    election: Election | None


def _refused(reason: Reason) -> Callable[[Counted], int]:
    return lambda board: (
        board.refused[reason] + sum(hearing.refused[reason] for hearing in board.hearings)
    )


COUNTS: tuple[Callable[[Counted], int], ...] = (
    lambda board: board.state_ticks[State.HOLDING],
    lambda board: board.state_ticks[State.EXTRAPOLATING],
    lambda board: board.state_ticks[State.RECKONING],
    lambda board: board.sensing.implausible_samples,
    lambda board: 0 if board.election is None else board.election.incomplete_epochs,
    *map(_refused, Reason),
)
"""How each is counted, in the order of `COUNTERS`."""
assert len(COUNTS) == len(COUNTERS)
