"""Events: what may be done to a robot, and what happens to it. One vocabulary, for all who read it.

Rule 1: commands come from a scenario or from a terminal. The plant puts them in order, at most one
        a tick, so every board obeys in the same tick, and a run can be played again (S15).
Rule 2: everything that a run went through is an event of a tick: between two ticks, in the middle
        of one, or as a consequence of others, by which union it is in. Consequences are computed
        again by a replay, the others are carried out.
Rule 3: what is read from outside is a member with all values within their bounds, or refused. Who
        acts on events does so in a `match` that ends in `assert_never`, or by one of the unions,
        so that mypy names every place that a new member has to touch.

An event is the same array everywhere, `[tag, field, ...]`: in a resolved scenario, on the wire from
a terminal, in a spool. What concerns a board reaches it as a `BoardCommand` in its observation.
"""

import re
from collections.abc import Iterator
from itertools import chain
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta, Struct

from protocol.robot import sensors
from protocol.robot.states import FaultCode

BOARDS_MAX = 2000
ANY = -1
DELAY_TICKS_MAX = 31
"""Delay and jitter together stay below 63, so that what a tick heard fits into one number."""
RAD_MAX = 3.2
"""A reference of more than half a turn is a mistake."""
FORCE_N_MAX = 1e4
LAST_TICKS_MAX = 10**7
"""How long a push or the fault of a sensor can last."""


class EventError(ValueError):
    """No event, or a command that cannot take effect; says why."""


def _unit(unit: str) -> dict[str, str]:
    return {"unit": unit}


Probability = Annotated[float, Meta(ge=0.0, le=1.0)]
WholeTicks = Annotated[float, Meta(ge=0.0, le=DELAY_TICKS_MAX, multiple_of=1.0)]
TICKS = _unit("ticks")


class LinkParameters(NamedTuple):
    """How bad a directed link is; probabilities are per frame."""

    loss: Annotated[Probability, Meta(description="probability that a frame is lost")] = 0.0
    burst_start: Annotated[
        Probability, Meta(description="Gilbert-Elliott: of changing from good to bad")
    ] = 0.0
    burst_end: Annotated[
        Probability, Meta(description="Gilbert-Elliott: of changing from bad to good")
    ] = 1.0
    burst_loss: Annotated[
        Probability, Meta(description="of loss in the bad state, on top of `loss`")
    ] = 1.0
    delay_ticks: Annotated[WholeTicks, Meta(description="how late a frame is", extra=TICKS)] = 0.0
    jitter_ticks: Annotated[
        WholeTicks, Meta(description="up to so much later, all equally likely", extra=TICKS)
    ] = 0.0
    duplicate: Annotated[Probability, Meta(description="that a frame comes twice")] = 0.0
    reorder: Annotated[
        Probability,
        Meta(description="that a frame is held back for a tick, so that the next overtakes it"),
    ] = 0.0
    corrupt: Annotated[Probability, Meta(description="that a bit is flipped on the way")] = 0.0
    cut: Annotated[Probability, Meta(description="1: nothing arrives", multiple_of=1.0)] = 0.0


PERFECT = LinkParameters()
IN_TICKS = frozenset({"delay_ticks", "jitter_ticks"})

Board = Annotated[int, Meta(ge=0, lt=BOARDS_MAX, description="a board, 0 is the lowest")]
OfLink = Annotated[int, Meta(ge=0, lt=BOARDS_MAX, description="a link, 0 is the lowest")]
Pairs = Annotated[
    tuple[tuple[Board, Board], ...],
    Meta(description="directed links, [sender, receiver] each; none: all"),
]
Radians = Annotated[float, Meta(ge=-RAD_MAX, le=RAD_MAX, extra=_unit("rad"))]


class _Array(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """Written as `[tag, field, ...]`."""


class LinkChange(_Array, frozen=True, tag="link"):
    """Directed links get other parameters."""

    pairs: Pairs
    changes: Annotated[
        dict[str, float],
        Meta(min_length=1, description="what of the links' parameters is to be otherwise"),
    ]

    def __post_init__(self) -> None:
        """Refuse what no link can have. Raises `EventError`."""
        check_changes(self.changes)


class LinkRepair(_Array, frozen=True, tag="heal"):
    """Directed links are perfect from here on."""

    pairs: Pairs


class ReferenceChange(_Array, frozen=True, tag="reference"):
    """A board gets another reference."""

    board: Board
    reference_rad: Annotated[Radians, Meta(description="of its controlled variable")]


class Push(_Array, frozen=True, tag="push"):
    """A link is pushed at its centre of mass."""

    link: OfLink
    force_n: Annotated[
        float,
        Meta(ge=-FORCE_N_MAX, le=FORCE_N_MAX, description="forward positive", extra=_unit("N")),
    ]
    ticks: Annotated[int, Meta(ge=1, le=LAST_TICKS_MAX, description="for how long", extra=TICKS)]


class SensorFault(_Array, frozen=True, tag="sensor"):
    """A sensor of a board fails, or is whole again (`protocol.robot.sensors`)."""

    board: Board
    sensor: Annotated[sensors.Faultable, Meta(description="which of its sensors")]
    fault: Annotated[sensors.FaultKind, Meta(description="how it fails; ok: it is whole again")]
    amount: Annotated[
        float,
        Meta(description="ticks of slow and delayed, probability of intermittent, else 0"),
    ]
    ticks: Annotated[
        int,
        Meta(ge=0, le=LAST_TICKS_MAX, description="for how long; 0: for good", extra=TICKS),
    ]

    def __post_init__(self) -> None:
        """Refuse an amount that this fault cannot have. Raises `EventError`."""
        trouble = sensors.amount_trouble(self.fault, self.amount)
        if trouble is not None:
            raise EventError(trouble)


class Unplug(_Array, frozen=True, tag="unplug"):
    """A board is to be taken away."""

    board: Board


class Plug(_Array, frozen=True, tag="plug"):
    """A board is to be put in."""

    board: Board


class Ready(_Array, frozen=True, tag="ready"):
    """A board that was put in a while ago has started up: the plant's own entry on its agenda."""

    board: Board


class Admission(_Array, frozen=True, tag="admitted"):
    """A joint has a board from here on."""

    board: Board
    incarnation: Annotated[
        int, Meta(ge=1, lt=2**32, description="how many boards the joint has had")
    ]


Why = Annotated[
    Literal["unplugged", "died", "silent"],
    Meta(description="it was told to go, its process ended, or the plant has given up on it"),
]


class Departure(_Array, frozen=True, tag="gone"):
    """A board is gone, between two ticks."""

    board: Board
    why: Why


class MidwayDeparture(_Array, frozen=True, tag="gone_midway"):
    """A board is gone that has been given its observation, and has not answered."""

    board: Board
    why: Why


class Excuse(_Array, frozen=True, tag="excused"):
    """A board goes on without a frame that it has waited for."""

    sender: Annotated[Board, Meta(description="whose frame it is")]
    receiver: Annotated[Board, Meta(description="who goes on")]


class EnergyLoss(_Array, frozen=True, tag="energy_lost_j"):
    """A joint without a board was braked."""

    board: Board
    energy_j: Annotated[float, Meta(description="what that took", extra=_unit("J"))]


class BoardFault(_Array, frozen=True, tag="fault"):
    """A board's controller or election has failed."""

    board: Board
    code: Annotated[FaultCode, Meta(description="what has failed")]
    text: Annotated[str, Meta(description="why and where, for people")]


class Sides(_Array, frozen=True, tag="sides"):
    """Who can reach whom is otherwise than before."""

    sides: Annotated[
        tuple[tuple[Board, ...], ...],
        Meta(description="the boards that are there, grouped by who reaches whom"),
    ]


class Tipping(_Array, frozen=True, tag="tipping"):
    """The foot begins to tip over its edge, or is flat again."""

    begins: Annotated[bool, Meta(description="whether it begins")]


class StaleTorque(_Array, frozen=True, tag="torque_stale"):
    """In realtime: the torque of a board is too old, so 0 N m are applied."""

    board: Board


class FreshTorque(_Array, frozen=True, tag="torque_fresh"):
    """In realtime: a board whose torque was too old has said a new one."""

    board: Board


LinkCommand = LinkChange | LinkRepair
Disturbance = Push
"""What acts on the body from outside; each lasts `ticks`."""
Plugging = Unplug | Plug
Command = LinkCommand | ReferenceChange | Disturbance | SensorFault | Plugging
"""What scenarios and terminals may ask for."""
Scheduled = Command | Ready
"""What may be on the agenda."""
BetweenTicks = Scheduled | Admission | Departure
Midway = MidwayDeparture | Excuse
Consequence = EnergyLoss | BoardFault | Sides | Tipping | StaleTorque | FreshTorque
Event = BetweenTicks | Midway | Consequence

WHEN: dict[type[Event], str] = {
    **dict.fromkeys(get_args(Command), "between two ticks, by command"),
    **dict.fromkeys(set(get_args(BetweenTicks)) - set(get_args(Command)), "between two ticks"),
    **dict.fromkeys(get_args(Midway), "in the middle of a tick"),
    **dict.fromkeys(get_args(Consequence), "as a consequence"),
}
"""When each comes; all there are."""


def tag_of(kind: "Event | type[Event]") -> str:
    """The word that an event is written with."""
    return str(kind.__struct_config__.tag)


EVENTS: dict[str, type[Event]] = {tag_of(kind): kind for kind in get_args(Event)}
COMMANDS: dict[str, type[Event]] = {tag_of(kind): kind for kind in get_args(Command)}
_PARAMETERS = LinkParameters.__annotations__
_BOARDS = {
    kind: [
        name
        for name, hint in get_type_hints(kind, include_extras=True).items()
        if any(isinstance(meta, Meta) and meta.lt == BOARDS_MAX for meta in hint.__metadata__)
    ]
    for kind in get_args(Event)
}
"""Which fields of an event are boards, joints or links of the body."""


def meaning_of(hint: Any) -> str:
    """What a field means, and its unit if it has one, from its annotated type."""
    described = [meta for meta in hint.__metadata__ if meta.description]
    units = [meta.extra["unit"] for meta in hint.__metadata__ if meta.extra]
    return ", ".join([described[-1].description, *units])


def values_of(event: Event) -> list[Any]:
    """Write an event as `[tag, field, ...]`."""
    values: list[Any] = msgspec.to_builtins(event)
    return values


def event_of(values: Any, *, strict: bool = True) -> Event:
    """Read `[tag, field, ...]`, of JSON if not strict: NaN is a word there. Raises `EventError`."""
    try:
        event: Event = msgspec.convert(values, Event, strict=strict)
    except msgspec.ValidationError as error:
        raise EventError(_complaint(str(error), values, EVENTS)) from error
    return event


def command_of(values: Any) -> Command:
    """Read `[tag, field, ...]` of a command. Raises `EventError`."""
    try:
        command: Command = msgspec.convert(values, Command)
    except msgspec.ValidationError as error:
        raise EventError(_complaint(str(error), values, COMMANDS)) from error
    return command


def check_event(event: Event, joints: list[str]) -> None:
    """Raise `EventError` if it cannot happen to a robot with these joints."""
    event_of(values_of(event))  # One that was made here has not been through this yet.
    for board in _boards_of(event):
        if board >= len(joints):
            raise EventError(f"there is no board {board}; the body has {', '.join(joints)}")
    if isinstance(event, LinkCommand):
        for sender, receiver in event.pairs:
            if abs(sender - receiver) != 1:
                raise EventError(f"{joints[sender]} and {joints[receiver]} have no link")


def check_changes(changes: dict[str, float]) -> None:
    """Raise `EventError` if no link can have one of these parameters."""
    for name, value in changes.items():
        if name not in _PARAMETERS:
            raise EventError(f"a link has no {name[:40]!r}; it has {', '.join(_PARAMETERS)}")
        try:
            msgspec.convert(value, _PARAMETERS[name])
        except msgspec.ValidationError as error:
            raise EventError(f"{name}: {_reason(str(error))}") from error


def changed(parameters: LinkParameters, changes: dict[str, float]) -> LinkParameters:
    """Return link parameters with some of them changed."""
    return parameters._replace(**{name: float(value) for name, value in changes.items()})


def concerns(command: LinkCommand, sender: int, receiver: int) -> bool:
    """Whether a command is about this directed link."""
    return not command.pairs or (sender, receiver) in command.pairs


def parameters_after(command: LinkCommand, now: LinkParameters) -> LinkParameters:
    """What a command makes of a link that it concerns."""
    return changed(now, command.changes) if isinstance(command, LinkChange) else PERFECT


class LinkOrder(_Array, frozen=True, tag=1):
    """A board gets new parameters of a link, or of all of its links."""

    sender: Annotated[
        int,
        Meta(ge=ANY, lt=BOARDS_MAX, description="whose frames are meant; -1: every neighbour's"),
    ]
    parameters: Annotated[LinkParameters, Meta(description="all, in their order")]


class ReferenceOrder(_Array, frozen=True, tag=2):
    """A board gets another reference."""

    reference_rad: Annotated[Radians, Meta(description="of its controlled variable")]


BoardCommand = LinkOrder | ReferenceOrder
"""A command as a board gets it: within its observation, without a CRC of its own."""
encode_board_command = msgspec.msgpack.Encoder().encode
_board_command = msgspec.msgpack.Decoder(BoardCommand)


def decode_board_command(payload: bytes) -> BoardCommand | None:
    """Read it; None if it is not one, or none that a link or a board can obey."""
    try:
        command: BoardCommand = _board_command.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    if isinstance(command, LinkOrder):
        *_, parameters = msgspec.msgpack.decode(payload)
        if len(parameters) != len(PERFECT):  # Those that are left out would be as in `PERFECT`.
            return None
    return command


def _boards_of(event: Event) -> Iterator[int]:
    """Boards, joints or links of the body that an event names."""
    yield from (getattr(event, name) for name in _BOARDS[type(event)])
    if isinstance(event, LinkCommand):
        yield from chain.from_iterable(event.pairs)
    if isinstance(event, Sides):
        yield from chain.from_iterable(event.sides)


_PLACE = re.compile(r"^(?P<reason>.*?)(?: - at `\$\[(?P<place>\d+)\].*`)?$", re.DOTALL)


def _complaint(text: str, values: Any, known: dict[str, type[Event]]) -> str:
    """What msgspec complains about, with the names of tag and field."""
    found = _PLACE.match(text)
    assert found is not None, "everything matches"
    tag = values[0] if isinstance(values, list | tuple) and values else None
    if not isinstance(tag, str):
        return f"not [what, ...]: {str(values)[:40]}"
    if tag not in known:
        return f"there is no {tag[:40]!r}; there are {', '.join(known)}"
    if found["place"] is None:
        return f"{tag}: {_reason(text)}"
    field = known[tag].__struct_fields__[int(found["place"]) - 1]
    reason = _reason(found["reason"])
    hint = get_type_hints(known[tag])[field]
    if get_origin(hint) is Literal:
        reason = f"{reason[:60]}; there are {', '.join(get_args(hint))}"
    return f"{tag}: {field}: {reason}"


def _reason(text: str) -> str:
    """A line of msgspec as a part of one of ours."""
    text = text.replace("`", "")
    return text[:1].lower() + text[1:150]
