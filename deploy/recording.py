"""A recording as arrays: the trajectory, what became of every frame, and when it all happened.

Rule 1: ticks are those since the release, 0 ... T-1, as in `Trajectory`; warm-up is left out.
Rule 2: a time is a monotonic one, in nanoseconds, and 0 where it is not known: the twin has none.
        Times of two processes may be subtracted only where `clocks_shared` is true.
Rule 3: the history of a link follows the frame, by the tick in which it was said.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deploy.trajectory import Trajectory

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Fate(IntEnum):
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
    """Not to be used: its sender did not complete the tick, or was replaced before it came late,
    or the receiver was told to go on without it (S5, S6)."""
    UNSAID = 7
    """There was no board to say it; `sent` is false."""
    PENDING = 8
    """The recording ends before it was due."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkHistory:
    """One directed link, frame by frame; each array has one entry for the tick it was said in."""

    sent: Flags
    """Whether a frame was sent, as far as the plant got to know: its sender answered, (T,)."""
    fate: Integers
    """`Fate`, (T,)."""
    heard_tick: Integers
    """The tick in which it was first used, or -1, (T,)."""
    frame_bytes: Integers
    """Size of the frame; 0 where it is not known, as the board at that end is not ours, (T,)."""
    sent_ns: Integers
    """When its sender said it, on the sender's clock; 0: not known, (T,)."""
    arrived_ns: Integers
    """When it arrived at its receiver, on the receiver's clock; 0: not known, (T,)."""
    refused: dict[str, int]
    """How many frames the receiver refused because of the link model, by `Reason`; warm-up too."""

    @property
    def bytes_sent(self) -> int:
        """Size of all frames sent."""
        return int(self.frame_bytes.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A run of T ticks with N joints, and all that is known of how it went."""

    trajectory: Trajectory
    facts: dict[str, Any]
    """Facts of the run that are not its scenario's: versions, machine, numeric fingerprint."""
    complete: bool
    """Whether the run said how it ended; else the end is missing."""
    logical_sha256: str
    """Digest of all that must be the same in processes and twin (S20)."""
    opened_ns: Integers
    """When the plant opened each tick, on its clock, (T,)."""
    answered_ns: Integers
    """When each board's answer was taken, on the plant's clock, (T, N)."""
    closed_ns: Integers
    """When the plant had integrated to the next tick, (T,)."""
    taken_up_ns: Integers
    """When each board took up its observation, on its own clock, (T, N)."""
    said_ns: Integers
    """When each board had said everything, on its own clock, (T, N)."""
    links: dict[tuple[int, int], LinkHistory]
    """By (sender, receiver), indices of boards."""
    refused_by_network: list[dict[str, int]]
    """For each board, how many frames it refused that no link model had touched, by `Reason`."""
    processes: dict[str, tuple[float, float]]
    """CPU seconds and peak memory in MB of "plant" and of each joint's process; empty in the
    twin."""
    clocks_shared: bool
    """Whether all processes read one clock, so that a frame's way can be timed."""
