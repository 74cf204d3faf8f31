"""What the messages of `run.mcap` say: JSON, with a schema that names and describes every field.

Rule 1: types are the plain ones that viewers know. JSON has no NaN, so a number that is none is the
        string "NaN", "Infinity" or "-Infinity".
Rule 2: a list of numbers has one for each joint, from the ground up, unless it says otherwise.
Rule 3: what has many shapes (a scenario, facts, an event) is there as JSON text, beside the fields
        that one looks for first.
"""

from typing import Any, NamedTuple

from deploy.recording.frame_fate import FrameFate
from protocol.robot.sensors import MEANINGS
from protocol.robot.states import State
from protocol.wire.frames import NO_TICK, Reason

NUMBER, INTEGER, TEXT = "number", "integer", "string"
Fields = dict[str, tuple[Any, str]]
"""By name: type and description. A type is a plain one, or a list of one: plain, or fields."""


class Kind(NamedTuple):
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
    (inner,) = type_
    return {"type": "array", "items": {"type": inner} if isinstance(inner, str) else _object(inner)}


TICK: Fields = {"tick": (INTEGER, "below 0 in warm-up; tick 0 releases the body")}
SENDER: Fields = {
    "run_id": (INTEGER, "name of the run in its frames"),
    "incarnation": (INTEGER, "which board this is of those that have had the joint, from 1"),
}
GOSSIP: Fields = {
    "epoch": (INTEGER, "epoch of the election; -1: none, and the three below mean nothing"),
    "round": (INTEGER, "rounds of max-consensus ended in this epoch"),
    "urgency": (NUMBER, "largest |error| known in this epoch, the paper's w; rad"),
    "candidate": (INTEGER, "board whose urgency that is, 0 is the lowest"),
}
READINGS: Fields = {field: (NUMBER, meaning) for field, meaning in MEANINGS.items()}

SCENARIO = Kind(
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
FACTS = Kind(
    "decmesh.Facts",
    "Where, when and with what it was run.",
    {
        "mode": (TEXT, "processes or twin"),
        "started": (TEXT, "UTC"),
        "fingerprint": (TEXT, "of the machine's arithmetic"),
        "all": (TEXT, "every fact, as JSON text: versions, host, clock"),
    },
)
PLANT_TICK = Kind(
    "decmesh.PlantTick",
    "The body in one tick.",
    {
        **TICK,
        "angles_rad": ([NUMBER], "joint angles at the start of the tick"),
        "rates_rad_s": ([NUMBER], "joint rates at the start of the tick"),
        "torques_nm": ([NUMBER], "torques applied to the joints in the tick"),
    },
)
OBSERVATION = Kind(
    "decmesh.Observation",
    "What the plant sent to one board at the start of a tick. Computed again from the recording.",
    {
        **SENDER,
        **TICK,
        **READINGS,
        "command_hex": (TEXT, "a board command of the wire specification; empty: none"),
        "neighbours": (
            [
                {
                    "incarnation": (INTEGER, "who is there; 0: nobody"),
                    "completed_tick": (INTEGER, f"last tick that it answered; {NO_TICK}: none"),
                    "waits": (INTEGER, "1: wait for its frame before ticking"),
                }
            ],
            "the roster as this board sees it, its lower neighbour first",
        ),
    },
)
TORQUE = Kind(
    "decmesh.Torque",
    "What a board answered, as recorded.",
    {
        **SENDER,
        **TICK,
        "torque_nm": (NUMBER, "what it asks for; what was applied is in /plant/tick"),
        "state": (INTEGER, ", ".join(f"{state.value}: {state.name.lower()}" for state in State)),
        "enabled": (INTEGER, "the enabling variable y: 1 moves, 0 holds"),
        "controlled_rad": (NUMBER, "controlled variable of one lumped delay ago"),
        **GOSSIP,
        "counter": (TEXT, "what is counted in this frame; the next tick has the next counter"),
        "counted": (INTEGER, "how many, since the board began"),
        "links": (
            [
                {
                    "heard_mask": (INTEGER, "bit j: used the frame sent in tick - 1 - j"),
                    "sent_crc": (INTEGER, "CRC-32 of the link frame that it sent"),
                    "unheard_ticks": (
                        INTEGER,
                        "since when the neighbour has used no frame of this board",
                    ),
                }
            ],
            "receipts, the lower neighbour first",
        ),
        "frame_hex": (TEXT, "the frame itself, where encoding these fields does not give it"),
    },
    frozenset({"frame_hex"}),
)
LINK = Kind(
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
        **SENDER,
        "echo_tick": (INTEGER, f"newest frame used from the addressee; {NO_TICK}: none"),
        **GOSSIP,
        "sample_tick": (INTEGER, f"when what follows was sampled; {NO_TICK}: it means nothing"),
        "lower_link_rad": (NUMBER, "orientation in space of the link below the shared joint"),
        "lower_link_rad_s": (NUMBER, "its rate"),
        "mass_kg": (NUMBER, "all that the shared joint carries; 0 in a frame that goes up"),
        "com_x_m": (NUMBER, "its centre of mass from that joint, forward; 0 upwards"),
        "com_y_m": (NUMBER, "upward; 0 upwards"),
        "com_x_m_s": (NUMBER, "its velocity; 0 upwards"),
        "com_y_m_s": (NUMBER, "its velocity; 0 upwards"),
    },
    frozenset({"sent_crc", *SENDER, *GOSSIP, "echo_tick", "sample_tick", "lower_link_rad"})
    | {"lower_link_rad_s", "mass_kg", "com_x_m", "com_y_m", "com_x_m_s", "com_y_m_s"},
)
EPOCH = Kind(
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
EVENT = Kind(
    "decmesh.Event",
    "What happened to the robot: commands, boards that came and went, verdicts of the plant.",
    {
        **TICK,
        "what": (TEXT, "first word of the event"),
        "event": (TEXT, "all of it, as JSON text"),
    },
)
TIMING = Kind(
    "decmesh.Timing",
    "When the plant did what in a tick, on its monotonic clock.",
    {
        **TICK,
        "opened_ns": (INTEGER, "before the observations went out"),
        "answered_ns": ([INTEGER], "each board's answer was taken; 0: there was none"),
        "closed_ns": (INTEGER, "after the last answer, before the body moved on"),
    },
)
BOARD_TIMING = Kind(
    "decmesh.BoardTiming",
    "When a board did what in some ticks, on its own monotonic clock, and what it has used.",
    {
        **SENDER,
        **TICK,
        "base_ns": (INTEGER, "a reading of its clock"),
        "clock": (INTEGER, "names the clock: equal numbers, one clock; 0: unknown"),
        "cpu_us": (INTEGER, "processor time of its process so far"),
        "memory_kb": (INTEGER, "most memory it has had resident"),
        "ticks": (
            [
                {
                    "taken_up_us": (INTEGER, "observation read, after base_ns, as all below"),
                    "decided_us": (INTEGER, "thought through; it began to speak"),
                    "said_us": (INTEGER, "the torque was put"),
                    "first_arrived_us": (INTEGER, "the lower neighbour's last frame; -1: none"),
                    "second_arrived_us": (INTEGER, "the other neighbour's; -1: none"),
                }
            ],
            "from `tick` on, without gaps",
        ),
    },
)
OUTCOME = Kind(
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
REFUSED = Kind(
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
