"""Events and link faults of a scenario: what a file may say, and the commands that it becomes.

    [[link]]                        [[event]]
    link = "all"                    at_s = 3.0
    loss = 0.2                      do = "cut"
                                    link = "ankle-knee"
                                    duration_s = 1.0

A link is named by its two joints, or "all". With `one_way` only frames from the first joint's board
to the second's are meant.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, NamedTuple, assert_never

from pydantic import BaseModel, ConfigDict, Field

from deploy.scenario_file.sensor_faults import FaultAmounts, fault_amount
from deploy.scenario_file.ticks import MeaningError, whole
from protocol.robot import events
from protocol.robot.events import DELAY_TICKS_MAX, PERFECT, Command, EventError, Pairs
from protocol.robot.scenario import LinkFaults
from protocol.robot.sensors import ALL, Faultable, FaultKind

Probability = Annotated[float, Field(ge=0, le=1)]
Milliseconds = Annotated[float, Field(ge=0, le=100_000)]
Seconds = Annotated[float, Field(ge=0, le=100_000)]
LINK_PATTERN = r"^(all|[a-z][a-z0-9_]*-[a-z][a-z0-9_]*)$"
LinkName = Annotated[str, Field(pattern=LINK_PATTERN)]


class LinkFaultTable(BaseModel):
    """How bad a link is; what is not given stays as it was."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    loss: Probability | None = None
    """Probability that a frame is lost."""
    burst_start: Probability | None = None
    """Probability per frame that a burst begins."""
    burst_end: Probability | None = None
    """Probability per frame that a burst ends."""
    burst_loss: Probability | None = None
    """Probability that a frame is lost in a burst."""
    delay_ms: Milliseconds | None = None
    """How late each frame is."""
    jitter_ms: Milliseconds | None = None
    """Up to so much later, uniformly distributed."""
    duplicate: Probability | None = None
    """Probability that a frame comes twice."""
    reorder: Probability | None = None
    """Probability that a frame is one tick later, and so comes after its successor."""
    corrupt: Probability | None = None
    """Probability that a frame is damaged."""


class StandingLink(LinkFaultTable):
    """A link that is bad from the start.

    Without a value it is perfect: burst_end and burst_loss are 1, all else is 0.
    """

    link: LinkName = "all"
    """Its two joints, such as knee-hip, or all."""
    one_way: bool = False
    """Only from the first joint's board to the second's."""


class EventTable(BaseModel):
    """Something that happens to the robot."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    at_s: Seconds
    """When, from the release of the body."""


class CutTable(EventTable):
    """Nothing passes the link any more, or not for `duration_s`."""

    do: Literal["cut"]
    link: LinkName
    """Its two joints, such as knee-hip, or all."""
    one_way: bool = False
    """Only from the first joint's board to the second's."""
    duration_s: Seconds | None = None
    """How long. None: for good."""


class HealTable(EventTable):
    """The link is perfect from here on."""

    do: Literal["heal"]
    link: LinkName = "all"
    """Its two joints, such as knee-hip, or all."""
    one_way: bool = False
    """Only from the first joint's board to the second's."""


class LinkFaultEventTable(EventTable, LinkFaultTable):
    """The link is as bad as given, or only for `duration_s`."""

    do: Literal["faults"]
    link: LinkName = "all"
    """Its two joints, such as knee-hip, or all."""
    one_way: bool = False
    """Only from the first joint's board to the second's."""
    duration_s: Seconds | None = None
    """How long. None: for good."""


class PushTable(EventTable):
    """A horizontal force at the centre of mass of a link, forward positive."""

    do: Literal["push"]
    segment: str
    """Name of the link."""
    force_n: Annotated[float, Field(ge=-10_000, le=10_000)]
    """Forward positive."""
    duration_s: Annotated[float, Field(gt=0, le=10_000)] = 0.1
    """How long."""


class ReferenceTable(EventTable):
    """A board gets another reference."""

    do: Literal["reference"]
    joint: str
    """Whose."""
    reference_deg: Annotated[float, Field(ge=-180, le=180)]
    """The new one."""


class PlugTable(EventTable):
    """A board is taken away (its process is killed), or a new one put in."""

    do: Literal["unplug", "plug"]
    joint: str
    """Whose board."""


class SensorFaultTable(EventTable, FaultAmounts):
    """A sensor of a board fails, or, with "ok", works again."""

    do: Literal["sensor"]
    joint: str
    """Whose."""
    sensor: Faultable = "encoder"
    """Which one of its sensors."""
    fault: FaultKind
    """How it fails; ok: it works again."""
    duration_s: Seconds | None = None
    """How long. None: for good."""


AnyEvent = Annotated[
    CutTable
    | HealTable
    | LinkFaultEventTable
    | PushTable
    | ReferenceTable
    | SensorFaultTable
    | PlugTable,
    Field(discriminator="do"),
]


class BodyNames(NamedTuple):
    """What names and times in events stand for."""

    joints: Sequence[str]
    segments: Sequence[str]
    sensors: Sequence[Sequence[str]]
    """Of each board."""
    tick_ms: float
    ticks: int


def directed_pairs(link: str, joints: Sequence[str], *, one_way: bool) -> Pairs:
    """Directed links (sender, receiver) that a name stands for; none stand for all.

    Raises `MeaningError`.
    """
    if link == "all":
        return ()
    one, dash, other = link.partition("-")
    if not dash:
        raise MeaningError(f"link: {link!r} is no link; write it like {'-'.join(joints[:2])}")
    names = one, other
    for name in names:
        if name not in joints:
            raise MeaningError(f"link: there is no joint {name!r}; there are {', '.join(joints)}")
    sender, receiver = (joints.index(name) for name in names)
    if abs(sender - receiver) != 1:
        raise MeaningError(f"link: {names[0]} and {names[1]} are no neighbours")
    there, back = (sender, receiver), (receiver, sender)
    return (there,) if one_way else (there, back)


def all_pairs(boards: int) -> Pairs:
    """Every directed link of a robot."""
    return tuple((a, b) for a in range(boards) for b in (a - 1, a + 1) if 0 <= b < boards)


def changes(table: LinkFaultTable, body: BodyNames) -> dict[str, float]:
    """Give the parameters of a link as `protocol.robot.events.LinkParameters` has them."""
    found = {}
    for name, value in table.model_dump(include=set(LinkFaultTable.model_fields)).items():
        if value is None:
            continue
        if name.endswith("_ms"):
            ticks = whole(value, body.tick_ms, name)
            if ticks > DELAY_TICKS_MAX:
                raise MeaningError(f"{name}: {ticks} ticks are more than {DELAY_TICKS_MAX}")
            found[name.replace("_ms", "_ticks")] = float(ticks)
        else:
            found[name] = float(value)
    return found


def standing_links(table: StandingLink, body: BodyNames) -> list[LinkFaults]:
    """Resolve a `[[link]]` table, for each directed link."""
    pairs = directed_pairs(table.link, body.joints, one_way=table.one_way)
    return [
        LinkFaults(*pair, changes(table, body)) for pair in pairs or all_pairs(len(body.joints))
    ]


def merged_links(tables: Sequence[StandingLink], body: BodyNames) -> list[LinkFaults]:
    """Resolve all `[[link]]` tables: one entry for each directed link, later tables on top."""
    found: dict[tuple[int, int], dict[str, float]] = {}
    for table in tables:
        for link in standing_links(table, body):
            found.setdefault((link.sender, link.receiver), {}).update(link.changes)
    return [LinkFaults(*pair, new) for pair, new in sorted(found.items())]


def commands(
    event: "AnyEvent", standing: Sequence[LinkFaults], body: BodyNames
) -> list[tuple[int, Command]]:
    """Resolve an `[[event]]` table to commands with their ticks. Raises `MeaningError`."""
    tick = whole(event.at_s * 1e3, body.tick_ms, "at_s")
    if tick >= body.ticks:
        raise MeaningError(f"at_s: {event.at_s:g} s is not before the end of the run")
    if isinstance(event, CutTable | LinkFaultEventTable):
        found = _for_a_while(event, tick, standing, body)
    else:
        found = [(tick, _command(event, body))]
    try:
        for _, command in found:
            events.check_event(command, list(body.joints))
    except EventError as error:
        raise MeaningError(str(error)) from error
    return found


def _command(
    event: "HealTable | PushTable | ReferenceTable | SensorFaultTable | PlugTable", body: BodyNames
) -> Command:
    """The one command that an event becomes."""
    command: Command
    match event:
        case HealTable():
            command = events.LinkRepair(
                directed_pairs(event.link, body.joints, one_way=event.one_way)
            )
        case PushTable():
            link = _index(event.segment, body.segments, "segment")
            ticks = whole(event.duration_s * 1e3, body.tick_ms, "duration_s")
            command = events.Push(link, float(event.force_n), ticks)
        case ReferenceTable():
            rad = math.radians(event.reference_deg)
            command = events.ReferenceChange(_index(event.joint, body.joints, "joint"), rad)
        case SensorFaultTable():
            command = _sensor_fault(event, body)
        case PlugTable():
            board = _index(event.joint, body.joints, "joint")
            command = events.Plug(board) if event.do == "plug" else events.Unplug(board)
        case _:
            assert_never(event)
    return command


def _for_a_while(
    event: CutTable | LinkFaultEventTable,
    tick: int,
    standing: Sequence[LinkFaults],
    body: BodyNames,
) -> list[tuple[int, Command]]:
    """Change links, and change them back to how the scenario has them for good."""
    pairs = directed_pairs(event.link, body.joints, one_way=event.one_way)
    new = {"cut": 1.0} if isinstance(event, CutTable) else changes(event, body)
    found: list[tuple[int, Command]] = [(tick, events.LinkChange(pairs, new))]
    if event.duration_s is None:
        return found
    end = tick + whole(event.duration_s * 1e3, body.tick_ms, "duration_s")
    before = {(link.sender, link.receiver): link.changes for link in standing}
    back: dict[tuple[float, ...], list[tuple[int, int]]] = {}
    for pair in pairs or all_pairs(len(body.joints)):
        old = before.get(pair, {})
        values = tuple(old.get(name, getattr(PERFECT, name)) for name in new)
        back.setdefault(values, []).append(pair)
    return found + [
        (end, events.LinkChange(tuple(pairs), dict(zip(new, values, strict=True))))
        for values, pairs in back.items()
    ]


def _sensor_fault(event: SensorFaultTable, body: BodyNames) -> events.SensorFault:
    board = _index(event.joint, body.joints, "joint")
    if event.sensor not in (*body.sensors[board], ALL):
        raise MeaningError(f"sensor: {event.joint} has no {event.sensor}")
    amount = fault_amount(event.fault, event, tick_ms=body.tick_ms)
    ticks = 0
    if event.duration_s is not None:
        ticks = max(1, whole(event.duration_s * 1e3, body.tick_ms, "duration_s"))
    return events.SensorFault(board, event.sensor, event.fault, amount, ticks)


def _index(name: str, names: Sequence[str], key: str) -> int:
    if name not in names:
        raise MeaningError(f"{key}: there is no {name!r}; there are {', '.join(names)}")
    return names.index(name)
