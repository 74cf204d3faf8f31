"""What happened to a robot: as lanes of a timeline, and as a list.

Rule 1: faults of links are what the commands made of them, tick by tick; what boards do, or that
        there is none, is what their answers say. Nothing is taken from the scenario's plan but its
        start.
"""

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

from deploy.outcome.drawing import spans
from deploy.recording.trajectory import Trajectory
from deploy.report.words import (
    ALL_LINKS,
    APART,
    Pair,
    Wording,
    faults_in_words,
    lanes_in_words,
    pairs_of,
    sides_in_words,
)
from plant_server.session.record import COMPLETE
from protocol.robot.events import (
    PERFECT,
    Admission,
    BoardFault,
    Disturbance,
    LinkCommand,
    LinkParameters,
    ReferenceChange,
    SensorFault,
    Sides,
    concerns,
    parameters_after,
)
from protocol.robot.scenario import Scenario
from protocol.robot.sensors import ALL, OK
from protocol.robot.states import State

PUSHED, REFERENCE = "pushed", "reference"


class HappeningKind(StrEnum):
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
    HappeningKind.AWAY: 0,
    HappeningKind.SYNCING: State.SYNCING,
    HappeningKind.SAFE: State.SAFE,
    HappeningKind.FAULT: State.FAULT,
}
"""In which a board does not drive."""


def absence(scenario: Scenario) -> str:
    """Name what a board is that says nothing: in realtime it may be there, and too late."""
    return HappeningKind.AWAY if scenario.realtime is None else "silent"


class Span(NamedTuple):
    """Something that went on from one tick to another."""

    lane: str
    first_tick: int
    end_tick: int
    kind: HappeningKind
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
        *_sensor_spans(trajectory),
        *_side_spans(trajectory),
        *_moments_and_pushes(trajectory),
    ]


def told(trajectory: Trajectory) -> list[Happening]:
    """Every event in words, but for the boards that were there from the start.

    Before them what was bad from the start, after them how it ended if it did not complete.
    """
    tell = Wording(trajectory.scenario)
    happened = [Happening(0, words) for words in tell.standing()]
    happened += [
        Happening(tick, tell.event(event))
        for tick, event in trajectory.events
        if tick >= 0 or not isinstance(event, Admission)
    ]
    if trajectory.ending != COMPLETE:
        happened.append(Happening(trajectory.ticks, f"the run ended: {trajectory.ending}"))
    return happened


def _link_spans(trajectory: Trajectory) -> Iterator[Span]:
    """Join spans of links that have the same faults at the same time."""
    joints = trajectory.scenario.joints
    alike: dict[tuple[int, int, LinkParameters], list[Pair]] = {}
    pairs = pairs_of(len(joints))
    for pair in pairs:
        for found in _faults(trajectory, pair):
            alike.setdefault(found, []).append(pair)
    rows = []
    for (first, end, parameters), bad in alike.items():
        kind = HappeningKind.CUT if parameters.cut else HappeningKind.FAULTS
        label = faults_in_words(parameters._asdict(), trajectory.tick_s)
        lanes = {ALL_LINKS: -1} if bad == pairs else lanes_in_words(bad, joints)
        rows += [(order, Span(lane, first, end, kind, label)) for lane, order in lanes.items()]
    yield from (span for _order, span in sorted(rows))


def _faults(trajectory: Trajectory, pair: Pair) -> Iterator[tuple[int, int, LinkParameters]]:
    """From which tick to which a directed link had which faults."""
    now = trajectory.scenario.standing_link(*pair)
    since = 0
    for tick, event in trajectory.events:
        if not isinstance(event, LinkCommand) or not concerns(event, *pair):
            continue
        then = parameters_after(event, now)
        if then != now:
            if now != PERFECT and tick > since:
                yield since, tick, now
            now, since = then, max(tick, 0)
    if now != PERFECT and trajectory.ticks > since:
        yield since, trajectory.ticks, now


def _board_spans(trajectory: Trajectory) -> Iterator[Span]:
    """While a board did not drive, or there was none; a fault with its code."""
    away = absence(trajectory.scenario)
    for board, joint in enumerate(trajectory.scenario.joints):
        found = [
            Span(joint, first, end, kind, away if kind is HappeningKind.AWAY else kind)
            for kind, state in STATES.items()
            for first, end in spans(trajectory.state[:, board] == state)
            if first > 0
            or kind is not HappeningKind.SYNCING  # In realtime what was said in warm-up holds.
        ]
        why = dict(_failures(trajectory, board))
        for span in sorted(found, key=lambda span: span.first_tick):
            since = [tick for tick in why if tick <= span.first_tick]
            known = span.kind is HappeningKind.FAULT and since
            yield span._replace(label=why[since[-1]]) if known else span


def _sensor_spans(trajectory: Trajectory) -> Iterator[Span]:
    """While a sensor was told to fail: until its time was over, or another command came."""
    joints = trajectory.scenario.joints
    told = [(tick, event) for tick, event in trajectory.events if isinstance(event, SensorFault)]
    for at, (tick, event) in enumerate(told):
        sensor = event.sensor
        ends = [tick + event.ticks] if event.ticks else []
        ends += [
            then
            for then, later in told[at + 1 :]
            if later.board == event.board
            and (sensor == later.sensor or ALL in (sensor, later.sensor))
        ]
        if event.fault != OK:
            label = f"{'all of them' if sensor == ALL else sensor} {event.fault}"
            end = min([*ends, trajectory.ticks])
            yield Span(
                f"{joints[event.board]} sensors", max(tick, 0), end, HappeningKind.FAULTS, label
            )


def _failures(trajectory: Trajectory, board: int) -> Iterator[tuple[int, str]]:
    for tick, event in trajectory.events:
        if isinstance(event, BoardFault) and event.board == board:
            yield tick, f"fault {event.code}: {event.code.title}"


def _side_spans(trajectory: Trajectory) -> Iterator[Span]:
    joints, since, label = trajectory.scenario.joints, 0, ""
    changes = [(tick, event.sides) for tick, event in trajectory.events if isinstance(event, Sides)]
    for tick, sides in [*changes, (trajectory.ticks, ())]:
        if label and tick > since:
            yield Span(APART, since, tick, HappeningKind.APART, label)
        since, label = max(tick, 0), sides_in_words(sides, joints) if len(sides) > 1 else ""


def _moments_and_pushes(trajectory: Trajectory) -> Iterator[Span]:
    tell = Wording(trajectory.scenario)
    for tick, event in trajectory.events:
        if isinstance(event, Disturbance):
            end = min(tick + event.ticks, trajectory.ticks)
            yield Span(PUSHED, tick, end, HappeningKind.PUSH, tell.label(event))
        elif isinstance(event, ReferenceChange):
            label = f"{tell.joints[event.board]} {math.degrees(event.reference_rad):g}°"
            yield Span(REFERENCE, tick, tick, HappeningKind.MOMENT, label)
