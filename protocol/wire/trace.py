"""Traces: what a board lived through, tick by tick, on its own clock (S24).

In realtime a board's ticks follow from when things arrived, so each is recorded: what it used, and
when. Ticks are told in batches, off the path to the deadline. From them a run is played again, and
every figure of time is made.

A board that is killed takes its last ticks along. So whoever finds a neighbour gone tells the last
frames that it took of it, each as a `LastWord`.
"""

from enum import IntFlag
from typing import Annotated, NamedTuple

from protocol.wire.fields import field

LINKS_MAX = 2


class Mark(IntFlag):
    """What else there is to say of a tick."""

    LATE = 1
    """Its torque was said after the period's end."""
    BEGAN = 2
    """It began an epoch."""
    LATCHED = 4
    """It ended the last round of an epoch."""
    MISSED_EPOCH = 8
    """It came too late to stand for an epoch."""


class TakenFrames(NamedTuple):
    """Which frames of a neighbour a period was played with, faults of the link aside."""

    newest_tick: Annotated[
        int,
        field(
            "of the newest frame taken of this neighbour so far; NO_TICK: none; unchanged: nothing"
            " new",
            difference=True,
        ),
    ]
    before: Annotated[
        int, field("bit j: with it, the frame sent j + 1 of its sender's periods before was taken")
    ]


class TickTrace(NamedTuple):
    """One tick of a board."""

    slot: Annotated[
        int, field("the board's own period that it is, counted from the release", difference=True)
    ]
    woke_us: Annotated[
        int, field("when it began, on the board's monotonic clock", unit="µs", difference=True)
    ]
    late_us: Annotated[
        int,
        field("how long after it, or the first of the periods skipped for it, was due", unit="µs"),
    ]
    busy_us: Annotated[int, field("how long until its torque was on the way", unit="µs")]
    phase_us: Annotated[
        int,
        field(
            "time since the slot began by the plant's ticks, as the board knew them when it woke",
            unit="µs",
        ),
    ]
    seen_tick: Annotated[int, field("of the observation that it used", difference=True)]
    skipped: Annotated[
        int, field("own periods left out before it, in which the board should have ticked")
    ]
    marks: Annotated[
        int,
        field(
            "bits: 1 said after the period's end; 2 opened an epoch; 4 latched; 8 too late for an"
            " epoch"
        ),
    ]
    taken: Annotated[tuple[TakenFrames, ...], field("per neighbour, which of its frames were used")]


class Trace(NamedTuple):
    """Some ticks of one board, in order."""

    run_id: Annotated[int, field("the run, as granted at enrolment")]
    incarnation: Annotated[int, field("of the sender")]
    lived: Annotated[tuple[TickTrace, ...], field("slots played, at least one, in order")]


class LastWord(NamedTuple):
    """A link frame that a board has taken of a neighbour that is gone now."""

    run_id: Annotated[int, field("the run, as granted at enrolment")]
    incarnation: Annotated[int, field("of the board that tells it")]
    sender: Annotated[int, field("number of the board that is gone, 0 is the lowest")]
    frame: Annotated[bytes, field("its link frame as it came, CRC included")]
