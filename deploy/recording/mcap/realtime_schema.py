"""What messages of a run in realtime say besides, or otherwise than in lockstep.

Rule: what is on a channel of lockstep as well has the same fields there, and may mean less.
"""

from deploy.recording.mcap.schema import (
    EPOCH,
    INTEGER,
    NUMBER,
    SENDER,
    TEXT,
    TORQUE,
    ChannelKind,
    mirrored,
)
from protocol.wire.trace import TickTrace

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
TURN = ChannelKind(
    "decmesh.Turn",
    "One pass of a board's loop: what it used, and when. Times are of its own monotonic clock.",
    {
        **SENDER,
        "tick": (INTEGER, "first tick of the slot; frames sent in this pass have it"),
        **mirrored(TickTrace),
        "follow": (INTEGER, "turns that follow in the same trace frame"),
        "frame_hex": (TEXT, "that frame, behind its last turn, where encoding does not give it"),
    },
    frozenset({"frame_hex"}),
)
LAST_WORD = ChannelKind(
    "decmesh.LastWord",
    "A frame that a board has used from a neighbour that is gone now.",
    {
        **SENDER,
        "sender": (INTEGER, "board that is gone, 0 is the lowest"),
        "frame_hex": (TEXT, "a frame of kind 9 of the wire specification, with the link frame"),
    },
)
PACE = ChannelKind(
    "decmesh.Pace",
    "How the plant kept up with the wall clock.",
    {
        "behind_ms_max": (NUMBER, "how late it was for a tick, at worst, in ms"),
        "slipped_s": (NUMBER, "wall time that it gave up because it was too late"),
    },
)
