"""Cadence: how the plant's ticks and each board's own periods go together in realtime mode.

Rule 1: ticks on the wire are always the plant's. A board's period is a whole number of them, and
        inside a board time counts in its own periods, so that nothing in it knows of the mode.
Rule 2: elections are played in rounds of so many plant ticks, the same for every board: twice the
        longest period, so that whatever a board says in one round is heard before the next.
"""

from typing import NamedTuple

from protocol.robot.scenario import Scenario


class Cadence(NamedTuple):
    """What a resolved scenario says of realtime mode."""

    ticks_per_period: tuple[int, ...]
    """Of each board, from the ground up."""
    ticks_per_round: int
    settle_ticks: int
    """How much longer than a delay line the body is held before it is released."""
    ahead_ticks_max: int
    """What was said more than this ahead of time is of another run: clocks differ by less."""
    age_ticks_max: int
    """What is older is not acted on: a torque by the plant, an observation by a board."""
    catches_up: bool
    """Whether a board makes up for periods that it has missed, or skips them."""


def cadence_of(scenario: Scenario) -> Cadence | None:
    """How a scenario has it; None in lockstep."""
    realtime = scenario.realtime
    if realtime is None:
        return None
    return Cadence(
        ticks_per_period=tuple(board.ticks_per_period or 1 for board in scenario.boards),
        ticks_per_round=realtime.ticks_per_round,
        settle_ticks=realtime.settle_ticks,
        ahead_ticks_max=realtime.ahead_ticks_max,
        age_ticks_max=realtime.age_ticks_max,
        catches_up=realtime.missed == "catch-up",
    )
