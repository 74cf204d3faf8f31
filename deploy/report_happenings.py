"""What happened to a robot: as lanes of a timeline, and in words.

Rule 1: faults of links are what the commands made of them, tick by tick; what boards do, or that
        there is none, is what their answers say. Nothing is taken from the scenario's plan but its
        start.
Rule 2: an event that this file does not know is told as it is recorded.
"""

import json
import math
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

from deploy.drawing import spans
from deploy.trajectory import Trajectory
from plant_server.config import plant_config
from plant_server.record import COMPLETE
from protocol.commands import PERFECT, TICKS, LinkParameters, changed, concerns
from protocol.sensors import OK
from protocol.states import FaultCode, State

ALL_LINKS, PUSHED, APART, REFERENCE = "all links", "pushed", "cut apart", "reference"
Pair = tuple[int, int]


class Kind(StrEnum):
    """What a span of the timeline shows."""

    CUT = "cut"
    FAULTS = "faults"
    AWAY = "no board"
    SYNCING = "filling its delay line"
    SAFE = "sensors say nothing plausible"
    FAULT = "fault"
    PUSH = "push"
    APART = "cut apart"
    MOMENT = "moment"
    """At one tick: it ends when it begins."""


STATES = {
    Kind.AWAY: 0,
    Kind.SYNCING: State.SYNCING,
    Kind.SAFE: State.SAFE,
    Kind.FAULT: State.FAULT,
}
"""In which a board does not drive."""


class Span(NamedTuple):
    """Something that went on from one tick to another."""

    lane: str
    first_tick: int
    end_tick: int
    kind: Kind
    label: str


class Happening(NamedTuple):
    """One event, in words."""

    tick: int
    words: str


def timeline(trajectory: Trajectory) -> list[Span]:
    """Everything that went on, lane by lane: links, boards, sides, pushes, references."""
    return [
        *_link_spans(trajectory),
        *_board_spans(trajectory),
        *_side_spans(trajectory),
        *_moments_and_pushes(trajectory),
    ]


def told(trajectory: Trajectory) -> list[Happening]:
    """Every event in words, but for the boards that were there from the start.

    Before them what was bad from the start, after them how it ended if it did not complete.
    """
    tell = _Words(trajectory.scenario)
    happened = [Happening(0, words) for words in tell.standing()]
    happened += [
        Happening(tick, tell.event(event))
        for tick, event in trajectory.events
        if tick >= 0 or event[0] != "admitted"
    ]
    if trajectory.ending != COMPLETE:
        happened.append(Happening(trajectory.ticks, f"the run ended: {trajectory.ending}"))
    return happened


def _link_spans(trajectory: Trajectory) -> Iterator[Span]:
    """Join spans of links that have the same faults at the same time."""
    joints = _joints(trajectory.scenario)
    alike: dict[tuple[int, int, LinkParameters], list[Pair]] = {}
    pairs = _pairs(len(joints))
    for pair in pairs:
        for found in _faults(trajectory, pair):
            alike.setdefault(found, []).append(pair)
    rows = []
    for (first, end, parameters), bad in alike.items():
        kind = Kind.CUT if parameters.cut else Kind.FAULTS
        label = _faults_in_words(parameters._asdict(), trajectory.tick_s)
        lanes = {ALL_LINKS: -1} if bad == pairs else _lanes(bad, joints)
        rows += [(order, Span(lane, first, end, kind, label)) for lane, order in lanes.items()]
    yield from (span for _order, span in sorted(rows))


def _faults(trajectory: Trajectory, pair: Pair) -> Iterator[tuple[int, int, LinkParameters]]:
    """From which tick to which a directed link had which faults."""
    now = plant_config(trajectory.scenario).standing_links.get(pair, PERFECT)
    since = 0
    for tick, event in trajectory.events:
        if event[0] not in {"link", "heal"} or not concerns(event, *pair):
            continue
        then = PERFECT if event[0] == "heal" else changed(now, event[2])
        if then != now:
            if now != PERFECT and tick > since:
                yield since, tick, now
            now, since = then, max(tick, 0)
    if now != PERFECT and trajectory.ticks > since:
        yield since, trajectory.ticks, now


def _lanes(bad: Sequence[Pair], joints: Sequence[str]) -> dict[str, int]:
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


def _board_spans(trajectory: Trajectory) -> Iterator[Span]:
    """While a board did not drive, or there was none; a fault with its code."""
    for board, joint in enumerate(_joints(trajectory.scenario)):
        found = [
            Span(joint, first, end, kind, kind)
            for kind, state in STATES.items()
            for first, end in spans(trajectory.state[:, board] == state)
            if first > 0 or kind is not Kind.SYNCING  # In realtime what was said in warm-up holds.
        ]
        why = dict(_failures(trajectory, board))
        for span in sorted(found, key=lambda span: span.first_tick):
            since = [tick for tick in why if tick <= span.first_tick]
            known = span.kind is Kind.FAULT and since
            yield span._replace(label=why[since[-1]]) if known else span


def _failures(trajectory: Trajectory, board: int) -> Iterator[tuple[int, str]]:
    for tick, event in trajectory.events:
        match event:
            case ["fault", int(whose), int(code), *_] if whose == board:
                yield tick, f"fault {code}: {_title_of(code)}"


def _side_spans(trajectory: Trajectory) -> Iterator[Span]:
    joints, since, label = _joints(trajectory.scenario), 0, ""
    changes = [(tick, event[1]) for tick, event in trajectory.events if event[0] == "sides"]
    for tick, sides in [*changes, (trajectory.ticks, [])]:
        if label and tick > since:
            yield Span(APART, since, tick, Kind.APART, label)
        since, label = max(tick, 0), _sides(sides, joints) if len(sides) > 1 else ""


def _moments_and_pushes(trajectory: Trajectory) -> Iterator[Span]:
    tell = _Words(trajectory.scenario)
    for tick, event in trajectory.events:
        match event:
            case ["push", link, force_n, ticks]:
                label = f"{tell.segments[link]} {force_n:+g} N"
                end = min(tick + ticks, trajectory.ticks)
                yield Span(PUSHED, tick, end, Kind.PUSH, label)
            case ["reference", board, rad]:
                label = f"{tell.joints[board]} {math.degrees(rad):g}°"
                yield Span(REFERENCE, tick, tick, Kind.MOMENT, label)


class _Words:
    """Says what happened, with the names of one robot."""

    def __init__(self, scenario: dict[str, Any]) -> None:
        self.joints = _joints(scenario)
        self.segments: list[str] = scenario["link_names"]
        self.tick_s: float = scenario["run"]["tick_s"]
        self.links = plant_config(scenario).standing_links

    def standing(self) -> Iterator[str]:
        """What the scenario has for bad links from the start, a clause for each kind of bad."""
        for parameters in dict.fromkeys(self.links.values()):
            bad = [pair for pair in _pairs(len(self.joints)) if self.links.get(pair) == parameters]
            named = [] if len(bad) == len(_pairs(len(self.joints))) else bad
            words = _faults_in_words(parameters._asdict(), self.tick_s)
            yield f"{self._links(named)}, from the start: {words}"

    def event(self, event: list[Any]) -> str:
        """One event as a clause."""
        match event:
            case ["link", pairs, changes]:
                words = f"{self._links(pairs)}: {_faults_in_words(changes, self.tick_s)}"
            case ["heal", pairs]:
                words = f"{self._links(pairs)}: perfect again"
            case ["push", link, force_n, ticks]:
                during = f"for {1e3 * ticks * self.tick_s:g} ms"
                words = f"{self.segments[link]}: pushed with {force_n:+g} N {during}"
            case ["sides", [side]]:
                words = f"connected: {_sides([side], self.joints)}"
            case ["sides", sides]:
                words = f"cut apart: {_sides(sides, self.joints)}"
            case ["excused", sender, receiver]:
                words = f"{self.joints[receiver]}: goes on without a frame of {self.joints[sender]}"
            case ["tipping", begins]:
                words = "the foot begins to tip" if begins else "the foot is flat again"
            case [str(what), int(board), *rest] if 0 <= board < len(self.joints):
                words = f"{self.joints[board]}: {_about_a_board(what, rest)}"
            case _:
                words = json.dumps(event)
        return words

    def _links(self, pairs: Sequence[Sequence[int]]) -> str:
        every = [(sender, receiver) for sender, receiver in pairs]
        return ", ".join(_lanes(every, self.joints)) if every else ALL_LINKS


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
        case "ready", []:
            words = "has started up"
        case "sensor", [sensor, fault, _amount, _ticks]:
            words = f"sensor {sensor} is {'whole again' if fault == OK else fault}"
        case "fault", [int(code), str(text)]:
            words = f"fault {code} ({_title_of(code)}): {'; '.join(text.splitlines())}"
        case "reference", [float(rad)]:
            words = f"reference {math.degrees(rad):g}°"
        case _:
            words = " ".join(map(str, [what, *rest]))
    return words


def _title_of(code: int) -> str:
    titles = {int(known): known.title for known in FaultCode}
    return titles.get(code, "of another version")


def _faults_in_words(faults: dict[str, float], tick_s: float) -> str:
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


def _sides(sides: Sequence[Sequence[int]], joints: Sequence[str]) -> str:
    return " | ".join(", ".join(joints[board] for board in side) for side in sides)


def _joints(scenario: dict[str, Any]) -> list[str]:
    return [board["joint"] for board in scenario["board"]]


def _pairs(boards: int) -> list[Pair]:
    return [(a, b) for a in range(boards) for b in (a - 1, a + 1) if 0 <= b < boards]
