"""What happened to a robot, in words: an event of a recording as a clause.

Rule 1: every event has words; mypy says where one lacks them.
"""

import math
from collections.abc import Iterator, Sequence
from typing import assert_never

from protocol.robot.events import (
    IN_TICKS,
    PERFECT,
    Admission,
    BoardFault,
    Departure,
    Disturbance,
    EnergyLoss,
    Event,
    Excuse,
    FreshTorque,
    LinkChange,
    LinkCommand,
    LinkRepair,
    MidwayDeparture,
    Pairs,
    Plug,
    Plugging,
    Push,
    Ready,
    ReferenceChange,
    SensorFault,
    Sides,
    StaleTorque,
    Tipping,
    Unplug,
)
from protocol.robot.scenario import Scenario
from protocol.robot.sensors import ALL, OK

ALL_LINKS, APART, NO_BOARD = "all links", "cut apart", "no board"
Pair = tuple[int, int]
OfBoard = (
    Ready
    | Admission
    | Departure
    | MidwayDeparture
    | EnergyLoss
    | BoardFault
    | StaleTorque
    | FreshTorque
)
"""What happens to one board, but for commands."""


class Wording:
    """Says what happened, with the names of one robot."""

    def __init__(self, scenario: Scenario) -> None:
        self.joints = scenario.joints
        self.segments = scenario.link_names
        self.tick_s = scenario.run.tick_s
        self.links = scenario.standing_links

    def standing(self) -> Iterator[str]:
        """What the scenario has for bad links from the start, a clause for each kind of bad."""
        for parameters in dict.fromkeys(self.links.values()):
            bad = [
                pair for pair in pairs_of(len(self.joints)) if self.links.get(pair) == parameters
            ]
            named = [] if len(bad) == len(pairs_of(len(self.joints))) else bad
            words = faults_in_words(parameters._asdict(), self.tick_s)
            yield f"{self._links(tuple(named))}, from the start: {words}"

    def event(self, event: Event) -> str:
        """One event as a clause."""
        if isinstance(event, LinkCommand):
            return f"{self._links(event.pairs)}: {self._of_links(event)}"
        if isinstance(event, Disturbance):
            return self._of_body(event)
        if isinstance(event, Excuse | Sides | Tipping):
            return self._of_robot(event)
        if isinstance(event, ReferenceChange | SensorFault | Plugging):
            return f"{self.joints[event.board]}: {self._of_command(event)}"
        return f"{self.joints[event.board]}: {_of_board(event)}"

    def label(self, event: Disturbance) -> str:
        """What acts on the body, in a few letters for a timeline."""
        match event:
            case Push(link, force_n, _):
                return f"{self.segments[link]} {force_n:+g} N"
            case _:
                assert_never(event)

    def _of_links(self, event: LinkCommand) -> str:
        match event:
            case LinkChange(_, changes):
                return faults_in_words(changes, self.tick_s)
            case LinkRepair():
                return "perfect again"
            case _:
                assert_never(event)

    def _of_body(self, event: Disturbance) -> str:
        match event:
            case Push(link, force_n, ticks):
                return f"{self.segments[link]}: pushed with {force_n:+g} N{self._during(ticks)}"
            case _:
                assert_never(event)

    def _of_robot(self, event: Excuse | Sides | Tipping) -> str:
        match event:
            case Excuse(sender, receiver):
                return f"{self.joints[receiver]}: goes on without a frame of {self.joints[sender]}"
            case Sides(sides):
                how = APART if len(sides) > 1 else "connected"
                return f"{how}: {sides_in_words(sides, self.joints) or NO_BOARD}"
            case Tipping(begins):
                return "the foot begins to tip" if begins else "the foot is flat again"
            case _:
                assert_never(event)

    def _of_command(self, event: ReferenceChange | SensorFault | Plugging) -> str:
        match event:
            case ReferenceChange(_, reference_rad):
                return f"reference {math.degrees(reference_rad):g}°"
            case SensorFault(_, which, fault, _, ticks):
                is_now = "whole again" if fault == OK else fault + self._during(ticks)
                return f"{'all sensors are' if which == ALL else f'sensor {which} is'} {is_now}"
            case Unplug():
                return "command unplug"
            case Plug():
                return "command plug"
            case _:
                assert_never(event)

    def _during(self, ticks: int) -> str:
        """For how long; of 0, nothing: for good."""
        return f" for {1e3 * ticks * self.tick_s:g} ms" if ticks else ""

    def _links(self, pairs: Pairs) -> str:
        return ", ".join(lanes_in_words(pairs, self.joints)) if pairs else ALL_LINKS


def _of_board(event: OfBoard) -> str:
    match event:
        case Ready():
            words = "has started up"
        case Admission(_, incarnation):
            words = f"admitted, incarnation {incarnation}"
        case Departure(_, why):
            words = f"gone: {why}"
        case MidwayDeparture(_, why):
            words = f"gone in the middle of the tick: {why}"
        case EnergyLoss(_, energy_j):
            words = f"joint braked, which took {energy_j:.3g} J"
        case BoardFault(_, code, text):
            words = f"fault {code} ({code.title}): {'; '.join(text.splitlines())}"
        case StaleTorque():
            words = "its torque is too old, so 0 N m are applied"
        case FreshTorque():
            words = "a new torque has come"
        case _:
            assert_never(event)
    return words


def faults_in_words(faults: dict[str, float], tick_s: float) -> str:
    """Name parameters that are bad; or, of a change, those that are bad no longer."""
    if faults.get("cut"):
        return "cut"
    bad = [
        f"{name.removesuffix('_ticks').replace('_', ' ')} "
        + (f"{1e3 * value * tick_s:g} ms" if name in IN_TICKS else f"{value:g}")
        for name, value in faults.items()
        if value != getattr(PERFECT, name)
    ]
    over = [name.removesuffix("_ticks").replace("_", " ") for name in faults]
    return ", ".join(bad) or f"end of {', '.join(over)}"


def sides_in_words(sides: Sequence[Sequence[int]], joints: Sequence[str]) -> str:
    """Name the boards on each side of a gap."""
    return " | ".join(", ".join(joints[board] for board in side) for side in sides)


def pairs_of(boards: int) -> list[Pair]:
    """All directed links, as sender and receiver."""
    return [(a, b) for a in range(boards) for b in (a - 1, a + 1) if 0 <= b < boards]


def lanes_in_words(bad: Sequence[Pair], joints: Sequence[str]) -> dict[str, int]:
    """Name links, both directions as one where both are meant; with their order."""
    lanes = {}
    for sender, receiver in bad:
        order = 2 * min(sender, receiver)
        if (receiver, sender) in bad:
            lower, upper = sorted((sender, receiver))
            lanes[f"{joints[lower]}-{joints[upper]}"] = order
        else:
            lanes[f"{joints[sender]} → {joints[receiver]}"] = order + 1
    return lanes
