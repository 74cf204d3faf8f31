"""What a run in realtime has besides, as messages of `run.mcap`: turns of boards, and their schema.

Rule 1: back and forth gives the same frames, to the byte. A turn says how many follow in its frame,
        so that it is known where frames begin and end.
Rule 2: what is on a channel of lockstep as well has the same fields there, and may mean less.
"""

from collections.abc import Iterator, Sequence

from deploy.recording.mcap.bodies import Body
from deploy.recording.mcap.schema import EPOCH, INTEGER, NUMBER, SENDER, TEXT, TORQUE, Kind
from protocol.wire.frames import NO_TICK
from protocol.wire.trace import LastWord, Lived, Mark, Taken, Trace, encode_trace

IN_FORCE = TORQUE._replace(
    about="The torque frame of a board that was in force in a tick, whenever it had come."
)
ELECTED = EPOCH._replace(
    about="One election, at the end of its epoch. Lists have one entry for each member.",
    fields={
        **EPOCH.fields,
        "tick": (INTEGER, "tick near the end of the epoch"),
        "members": ([TEXT], "joints whose boards were in it at its end, from the ground up"),
        "w_rad": ([NUMBER], "urgencies that they began with, the paper's w; NaN: nobody knows"),
    },
)
TURN = Kind(
    "decmesh.Turn",
    "One pass of a board's loop: what it used, and when. Times are of its own monotonic clock.",
    {
        **SENDER,
        "tick": (INTEGER, "first tick of the slot; frames sent in this pass have it"),
        "slot": (INTEGER, "the board's own period that was played, counted from the release"),
        "woke_us": (INTEGER, "when the turn began, in us"),
        "late_us": (INTEGER, "how long after it, or the first slot skipped for it, was due, in us"),
        "busy_us": (INTEGER, "from then until its torque was on the way, in us"),
        "phase_us": (INTEGER, "since the slot began by the plant's ticks, as it knew them, in us"),
        "seen_tick": (INTEGER, "tick of the observation that it used"),
        "skipped": (INTEGER, "slots since the turn before that it did not play"),
        "marks": (
            INTEGER,
            "bits; " + ", ".join(f"{mark.value}: {mark.name}".lower() for mark in Mark),
        ),
        "taken": (
            [
                {
                    "newest_tick": (INTEGER, f"when the newest so far was sent; {NO_TICK}: none"),
                    "before": (
                        INTEGER,
                        "bit j: with it, the frame sent j + 1 of its sender's periods before",
                    ),
                }
            ],
            "frames used, the lower neighbour first; newest_tick as the turn before: nothing new",
        ),
        "follow": (INTEGER, "turns that follow in the same trace frame"),
        "frame_hex": (TEXT, "that frame, behind its last turn, where encoding does not give it"),
    },
    frozenset({"frame_hex"}),
)
LAST_WORD = Kind(
    "decmesh.LastWord",
    "A frame that a board has used from a neighbour that is gone now.",
    {
        **SENDER,
        "sender": (INTEGER, "board that is gone, 0 is the lowest"),
        "frame_hex": (TEXT, "a frame of kind 9 of the wire specification, with the link frame"),
    },
)
PACE = Kind(
    "decmesh.Pace",
    "How the plant kept up with the wall clock.",
    {
        "behind_ms_max": (NUMBER, "how late it was for a tick, at worst, in ms"),
        "slipped_s": (NUMBER, "wall time that it gave up because it was too late"),
    },
)


def of_trace(trace: Trace, payload: bytes, ticks_per_period: int) -> Iterator[Body]:
    """The turns of one trace frame, in order."""
    for follow, lived in zip(reversed(range(len(trace.lived))), trace.lived, strict=True):
        body = {
            "run_id": trace.run_id,
            "incarnation": trace.incarnation,
            "tick": lived.slot * ticks_per_period,
            **lived._asdict(),
            "taken": [taken._asdict() for taken in lived.taken],
            "follow": follow,
        }
        if not follow and encode_trace(trace) != payload:  # Foreign, but right, as torques are.
            body["frame_hex"] = payload.hex()
        yield body


def to_frame(turns: Sequence[Body]) -> bytes:
    """The frame of which these are the turns, or the last word; as it was on the wire."""
    last = turns[-1]
    if "frame_hex" in last:
        return bytes.fromhex(last["frame_hex"])
    lived = tuple(
        Lived(**{name: turn[name] for name in Lived._fields[:-1]}, taken=_taken(turn["taken"]))
        for turn in turns
    )
    return encode_trace(Trace(last["run_id"], last["incarnation"], lived))


def _taken(links: Sequence[dict[str, int]]) -> tuple[Taken, ...]:
    return tuple(Taken(**link) for link in links)


def of_last_word(word: LastWord, payload: bytes) -> Body:
    """What was heard last of a board."""
    return {
        "run_id": word.run_id,
        "incarnation": word.incarnation,
        "sender": word.sender,
        "frame_hex": payload.hex(),
    }


def to_pace(body: Body) -> dict[str, float]:
    """The plant's account."""
    return {name: float(body[name]) for name in PACE.fields}
