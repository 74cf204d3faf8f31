"""What messages of a run in realtime say besides, or otherwise than in lockstep.

Rule: what is on a channel of lockstep as well has the same fields there, and may mean less.
"""

from deploy.recording.mcap.schema import EPOCH, INTEGER, NUMBER, SENDER, TEXT, TORQUE, Kind
from protocol.wire.frames import NO_TICK
from protocol.wire.trace import Mark

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
