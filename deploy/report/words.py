"""What happened to a robot, in words: an event of a recording as a clause.

Rule 1: an event that this file does not know is told as it is recorded.
"""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from protocol.robot.commands import PERFECT, TICKS
from protocol.robot.scenario import Scenario
from protocol.robot.sensors import ALL, OK
from protocol.robot.states import FaultCode

ALL_LINKS, APART, NO_BOARD = "all links", "cut apart", "no board"
SIMPLE = {
    "ready": "has started up",
    "torque_stale": "its torque is too old, so 0 N m are applied",
    "torque_fresh": "a new torque has come",
}
"""What happened to a board, where its name says it all."""
Pair = tuple[int, int]


class Words:
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
            yield f"{self._links(named)}, from the start: {words}"

    def event(self, event: list[Any]) -> str:
        """One event as a clause."""
        match event:
            case ["link", pairs, changes]:
                words = f"{self._links(pairs)}: {faults_in_words(changes, self.tick_s)}"
            case ["heal", pairs]:
                words = f"{self._links(pairs)}: perfect again"
            case ["push", link, force_n, ticks]:
                during = f"for {1e3 * ticks * self.tick_s:g} ms"
                words = f"{self.segments[link]}: pushed with {force_n:+g} N {during}"
            case ["sides", sides]:
                words = f"{APART if len(sides) > 1 else 'connected'}: "
                words += sides_in_words(sides, self.joints) or NO_BOARD
            case ["excused", sender, receiver]:
                words = f"{self.joints[receiver]}: goes on without a frame of {self.joints[sender]}"
            case ["sensor", int(board), str(which), str(fault), _amount, int(ticks)]:
                during = f" for {1e3 * ticks * self.tick_s:g} ms" if ticks else ""
                is_now = "whole again" if fault == OK else fault + during
                subject = "all sensors are" if which == ALL else f"sensor {which} is"
                words = f"{self.joints[board]}: {subject} {is_now}"
            case ["tipping", begins]:
                words = "the foot begins to tip" if begins else "the foot is flat again"
            case [str(what), int(board), *rest] if 0 <= board < len(self.joints):
                words = f"{self.joints[board]}: {_about_a_board(what, rest)}"
            case _:
                words = json.dumps(event)
        return words

    def _links(self, pairs: Sequence[Sequence[int]]) -> str:
        every = [(sender, receiver) for sender, receiver in pairs]
        return ", ".join(lanes_in_words(every, self.joints)) if every else ALL_LINKS


def _about_a_board(what: str, rest: list[Any]) -> str:
    match what, rest:
        case "admitted", [incarnation]:
            words = f"admitted, incarnation {incarnation}"
        case "gone", [why]:
            words = f"gone: {why}"
        case "gone_midway", [why]:
            words = f"gone in the middle of the tick: {why}"
        case "energy_lost_j", [float(lost_j)]:
            words = f"joint braked, which took {lost_j:.3g} J"
        case "unplug" | "plug", []:
            words = f"command {what}"
        case _, [] if what in SIMPLE:
            words = SIMPLE[what]
        case "fault", [int(code), str(text)]:
            words = f"fault {code} ({title_of(code)}): {'; '.join(text.splitlines())}"
        case "reference", [float(rad)]:
            words = f"reference {math.degrees(rad):g}°"
        case _:
            words = " ".join(map(str, [what, *rest]))
    return words


def title_of(code: int) -> str:
    """Name a fault code."""
    titles = {int(known): known.title for known in FaultCode}
    return titles.get(code, "of another version")


def faults_in_words(faults: dict[str, float], tick_s: float) -> str:
    """Name parameters that are bad; or, of a change, those that are bad no longer."""
    if faults.get("cut"):
        return "cut"
    bad = [
        f"{name.removesuffix('_ticks').replace('_', ' ')} "
        + (f"{1e3 * value * tick_s:g} ms" if name in TICKS else f"{value:g}")
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
