"""Counts: where a board keeps each of the numbers that it tells of itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from protocol.frames import Reason
from protocol.states import COUNTERS, State

if TYPE_CHECKING:
    from collections.abc import Callable

    from module_agent.board import Board


def _refused(reason: Reason) -> Callable[[Board], int]:
    return lambda board: (
        board.refused[reason] + sum(hearing.refused[reason] for hearing in board.hearings)
    )


COUNTS: tuple[Callable[[Board], int], ...] = (
    lambda board: board.state_ticks[State.HOLDING],
    lambda board: board.state_ticks[State.EXTRAPOLATING],
    lambda board: board.state_ticks[State.RECKONING],
    lambda board: board.sensing.implausible_samples,
    lambda board: 0 if board.election is None else board.election.incomplete_epochs,
    *map(_refused, Reason),
    lambda board: board.sensing.inconsistent_samples,
    lambda board: board.sensing.stuck_samples,
)
"""In the order of `protocol.states.COUNTERS`."""
assert len(COUNTS) == len(COUNTERS)
