"""What can become of a link frame."""

from enum import IntEnum

from protocol.wire.frames import NO_TICK

NEVER = NO_TICK
"""In place of the tick in which a frame was heard; -1 is one of the warm-up."""


class FrameFate(IntEnum):
    """What became of a link frame in the end."""

    HEARD = 0
    """Used in the tick after it was said."""
    LATE = 1
    """Used later, by a delay or a reordering of the link model."""
    LOST = 2
    """Dropped by the link model: random or burst loss."""
    CORRUPT = 3
    """A bit was flipped by the link model, and the receiver refused it."""
    CUT = 4
    """The link was cut."""
    NOBODY = 5
    """There was no board at the other end when it would have been heard, or a new one."""
    VOID = 6
    """Not to be used: its sender did not complete the tick, or was gone when it would have been
    heard, or the receiver was told to go on without it (S5, S6)."""
    UNSAID = 7
    """There was no board to say it."""
    PENDING = 8
    """The recording ends before it was due."""
