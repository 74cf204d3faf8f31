"""What the messages of `run.mcap` say: JSON, with a schema that names and describes every field.

Rule 1: types are the plain ones that viewers know. JSON has no NaN, so a number that is none is the
        string "NaN", "Infinity" or "-Infinity".
Rule 2: a list of numbers has one for each joint, from the ground up, unless it says otherwise.
Rule 3: what has many shapes (a scenario, facts) is there as JSON text, beside the fields that one
        looks for first. An event has the fields of its kind, and no others.
Rule 4: what mirrors a message of the wire has its fields and their meaning from there.
"""

from collections.abc import Container
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

from deploy.recording.frame_fate import FrameFate
from protocol.robot.events import EVENTS, meaning_of
from protocol.wire import frames
from protocol.wire.fields import fields
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame, Observation, Reason, TorqueFrame

NUMBER, INTEGER, TEXT = "number", "integer", "string"
Fields = dict[str, tuple[Any, str]]
"""By name: type and description. A type is a plain one, or a list of one: plain, or fields."""


class ChannelKind(NamedTuple):
    """A kind of message."""

    name: str
    about: str
    fields: Fields
    optional: frozenset[str] = frozenset()
    """Fields that may be missing."""

    @property
    def schema(self) -> dict[str, Any]:
        """Its JSON schema."""
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": self.name,
            "description": self.about,
            **_object(self.fields, self.optional),
        }


def _object(fields: Fields, optional: frozenset[str] = frozenset()) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {
            name: {**_type(type_), "description": about} for name, (type_, about) in fields.items()
        },
        "required": [name for name in fields if name not in optional],
    }


def _type(type_: Any) -> dict[str, Any]:
    if isinstance(type_, str):
        return {"type": type_}
    if isinstance(type_, dict):
        return _object(type_)
    (inner,) = type_
    return {"type": "array", "items": _type(inner)}


PLAIN: dict[type, str] = {bool: "boolean", int: INTEGER, float: NUMBER, str: TEXT, dict: "object"}


def _plain(hint: Any) -> Any:
    """What a Python type is in JSON."""
    kind = get_origin(hint) or hint
    if kind is Annotated:
        return _plain(get_args(hint)[0])
    if kind is tuple:
        return [_plain(get_args(hint)[0])]
    if kind is Literal:
        return TEXT
    return next(name for plain, name in PLAIN.items() if issubclass(kind, plain))


def _event_fields() -> Fields:
    """The fields of all events; who has one of them says what it means."""
    types: dict[str, Any] = {}
    meanings: dict[str, dict[str, list[str]]] = {}
    for tag, kind in EVENTS.items():
        for name, hint in get_type_hints(kind, include_extras=True).items():
            types[name] = _plain(hint)
            meanings.setdefault(name, {}).setdefault(meaning_of(hint), []).append(tag)
    return {
        name: (
            types[name],
            "; ".join(f"{', '.join(tags)}: {about}" for about, tags in abouts.items()),
        )
        for name, abouts in meanings.items()
    }


def mirrored(message: type, *, without: Container[str] = ()) -> Fields:
    """Fields of what mirrors a message of the wire, as that describes them.

    Bytes are in hex; what stands in an array of its own, if only once, stands beside the others.
    """
    found: Fields = {}
    for of in fields(message):
        if of.name in without:
            continue
        about = _spelled(f"{of.meaning}, in {of.unit}" if of.unit else of.meaning)
        if of.repeats:
            found[of.name] = ([mirrored(of.type)], about)
        elif of.type is bytes:
            found[f"{of.name}_hex"] = (TEXT, about)
        elif of.type in PLAIN:
            found[of.name] = (PLAIN[of.type], about)
        else:
            found |= mirrored(of.type)
    return found


def _spelled(meaning: str) -> str:
    """Put numbers in place of names that only the specification explains."""
    return meaning.replace("NO_TICK", str(NO_TICK)).replace("NO_EPOCH", str(NO_EPOCH))


TICK: Fields = {"tick": (INTEGER, "below 0 in warm-up; tick 0 releases the body")}
SENDER: Fields = {name: mirrored(LinkFrame)[name] for name in ("run_id", "incarnation")}

SCENARIO = ChannelKind(
    "decmesh.Scenario",
    "What was run.",
    {
        "name": (TEXT, "name of the scenario"),
        "seed": (INTEGER, "of everything random"),
        "joints": ([TEXT], "from the ground up"),
        "tick_s": (NUMBER, "length of a tick"),
        "digest": (TEXT, "SHA-256 of the resolved scenario without its rig, hex"),
        "resolved": (TEXT, "every value of the scenario, as JSON text"),
    },
)
FACTS = ChannelKind(
    "decmesh.Facts",
    "Where, when and with what it was run.",
    {
        "mode": (TEXT, "processes or twin"),
        "started": (TEXT, "UTC"),
        "fingerprint": (TEXT, "of the machine's arithmetic"),
        "all": (TEXT, "every fact, as JSON text: versions, host, clock"),
    },
)
PLANT_TICK = ChannelKind(
    "decmesh.PlantTick",
    "The body in one tick.",
    {
        **TICK,
        "angles_rad": ([NUMBER], "joint angles at the start of the tick"),
        "rates_rad_s": ([NUMBER], "joint rates at the start of the tick"),
        "torques_nm": ([NUMBER], "torques applied to the joints in the tick"),
    },
)
OBSERVATION = ChannelKind(
    "decmesh.Observation",
    "What the plant sent to one board at the start of a tick. Computed again from the recording.",
    mirrored(Observation),
)
TORQUE = ChannelKind(
    "decmesh.Torque",
    "What a board answered, as recorded.",
    {
        **mirrored(TorqueFrame),
        "counter": (TEXT, "what is counted in this frame; the next tick has the next counter"),
        "frame_hex": (TEXT, "the frame itself, where encoding these fields does not give it"),
    },
    frozenset({"frame_hex"}),
)
_SAID = mirrored(LinkFrame, without={"tick", "heard_tick"})
LINK = ChannelKind(
    "decmesh.LinkFrame",
    "What a board sent to a neighbour, and what became of it. Computed again, and checked by the"
    " CRC-32 in the sender's receipt; of a board that is not ours, or that did not complete the"
    " tick, there is the fate alone.",
    {
        **TICK,
        "fate": (TEXT, ", ".join(fate.name.lower() for fate in FrameFate)),
        "heard_tick": (INTEGER, f"when it was used first; {NO_TICK}: never"),
        "sent_crc": (INTEGER, "CRC-32 of the frame, by its sender's receipt, if there is one"),
        "frame_bytes": (INTEGER, "its size on the wire; 0: not known"),
        "echo_tick": mirrored(LinkFrame)["heard_tick"],
        **_SAID,
    },
    frozenset({"sent_crc", "echo_tick", *_SAID}),
)
EPOCH = ChannelKind(
    "decmesh.Epoch",
    "One election, when its last round is over. Lists have one entry for each member.",
    {
        "epoch": (INTEGER, "its number, from 0"),
        "tick": (INTEGER, "when it was over and the boards decided"),
        "began_tick": (INTEGER, "when it began"),
        "members": ([TEXT], "joints whose boards began it, from the ground up"),
        "w_rad": ([NUMBER], "urgencies that they began with, the paper's w"),
        "rounds_to_agreement": (INTEGER, "after which all knew the largest w; -1: they did not"),
        "known_after_rounds": ([INTEGER], "after which each knew the largest w; -1: it did not"),
        "y": ([INTEGER], "enabling variables in the end: 1 moves, 0 holds"),
    },
)
EVENT = ChannelKind(
    "decmesh.Event",
    "What happened to the robot: commands, boards that came and went, verdicts of the plant.",
    {**TICK, "what": (TEXT, ", ".join(EVENTS)), **_event_fields()},
    frozenset(_event_fields()),
)
TIMING = ChannelKind(
    "decmesh.Timing",
    "When the plant did what in a tick, on its monotonic clock.",
    {
        **TICK,
        "opened_ns": (INTEGER, "before the observations went out"),
        "answered_ns": ([INTEGER], "each board's answer was taken; 0: there was none"),
        "closed_ns": (INTEGER, "after the last answer, before the body moved on"),
    },
)
REPORTS = {
    kind: ChannelKind(f"decmesh.Board{kind.__name__}", (kind.__doc__ or "").strip(), mirrored(kind))
    for kind in frames.REPORTS
}
"""What boards tell for the recording alone."""
OUTCOME = ChannelKind(
    "decmesh.Outcome",
    "How the run ended.",
    {
        "tick": (INTEGER, "how many ticks the body was free"),
        "angles_rad": ([NUMBER], "joint angles after the last tick"),
        "rates_rad_s": ([NUMBER], "joint rates after the last tick"),
        "ending": (TEXT, "complete, fell, or why it was cut short"),
        "wall_s": (NUMBER, "wall time from the release to the end"),
        "undriven": (
            [
                {
                    "joint": (TEXT, "that nobody drove"),
                    "since_tick": (INTEGER, "since when"),
                    "how": (TEXT, "limp, braked or passive meanwhile"),
                    "has_board": (INTEGER, "1: a board was in, but had not driven yet"),
                }
            ],
            "joints that nobody drove in the end",
        ),
    },
)
REFUSED = ChannelKind(
    "decmesh.Refused",
    "Frames that boards refused in the whole run, warm-up included.",
    {
        "by_link": (
            [
                {
                    "sender": (TEXT, "whose board sent them"),
                    "receiver": (TEXT, "whose board refused them"),
                    "reason": (TEXT, ", ".join(Reason)),
                    "frames": (INTEGER, "how many, had the network brought everything once"),
                }
            ],
            "on each directed link: frames that the link model had damaged, or that were void",
        ),
        "by_network": (
            [
                {
                    "joint": (TEXT, "whose board refused them"),
                    "reason": (TEXT, ", ".join(Reason)),
                    "frames": (INTEGER, "how many"),
                }
            ],
            "frames that no link model had touched",
        ),
    },
)
