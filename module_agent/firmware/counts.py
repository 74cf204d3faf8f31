"""Counts: where a board keeps each of the numbers that it tells of itself."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Protocol

from module_agent.firmware.election import Election
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.sensing import Sensing
from protocol.robot.states import COUNTERS, State
from protocol.wire.frames import Reason


class Counted(Protocol):
    """What of a board is counted."""

    state_ticks: list[int]
    """By state."""
    refused: Counter[Reason]
    """Observations that could not be used."""

    @property
    def hearings(self) -> Sequence[Hearing]:
        """Its links."""

    @property
    def sensing(self) -> Sensing:
        """Its sensors."""

    @property
    def election(self) -> Election | None:
        """Its part in the elections."""


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
    lambda board: board.sensing.inconsistent_samples,
    lambda board: board.sensing.stuck_samples,
)
"""In the order of `protocol.robot.states.COUNTERS`."""
assert len(COUNTS) == len(COUNTERS)
