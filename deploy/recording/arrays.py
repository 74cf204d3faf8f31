"""A recording as arrays: the trajectory, what became of every frame, and when it all happened.

Rule 1: ticks are those since the release, 0 ... T-1, as in `Trajectory`; warm-up is left out.
Rule 2: a time is a monotonic one, in nanoseconds, and 0 where it is not known: the twin has none.
        Times of two processes may be subtracted only where `clocks_shared` is true.
Rule 3: the history of a link follows the frame, by the tick in which it was said.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deploy.recording.epochs import Epochs
from deploy.recording.frame_fate import FrameFate
from deploy.recording.realtime_times import RealtimeTimes
from deploy.recording.trajectory import Trajectory

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

__all__ = ["FrameFate", "LinkHistory", "Recording"]

NOT_HEARD = -1
"""In arrays, in place of the tick in which a frame was heard."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkHistory:
    """One directed link, frame by frame; each array has one entry for the tick it was said in."""

    sent: Flags
    """Whether a frame was sent, as far as the plant got to know: its sender answered, (T,)."""
    fate: Integers
    """`FrameFate`, (T,)."""
    heard_tick: Integers
    """The tick in which it was first used, or `NOT_HEARD`, (T,)."""
    frame_bytes: Integers
    """Size of the frame; 0 where it is not known, as the board at that end is not ours, (T,)."""
    sent_ns: Integers
    """When its sender began to speak, on the sender's clock; 0: not known, (T,)."""
    arrived_ns: Integers
    """When it arrived at its receiver, on the receiver's clock; 0: not known, (T,)."""
    refused: dict[str, int]
    """How many frames the receiver refused, by `frames.Reason`, had the network brought
    everything once: those that the link model damaged, and those that were void. Warm-up too."""

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
    """When the last answer had been taken, before the body moved on, (T,)."""
    taken_up_ns: Integers
    """When each board took up its observation, on its own clock, (T, N)."""
    decided_ns: Integers
    """When each board had thought the tick through, and began to speak, (T, N)."""
    said_ns: Integers
    """When each board had said everything, on its own clock, (T, N)."""
    epochs: Epochs | None
    """None where nobody is elected."""
    links: dict[tuple[int, int], LinkHistory]
    """By (sender, receiver), indices of boards."""
    refused_by_network: list[dict[str, int]]
    """For each board, how many frames it refused that no link model had touched, by `Reason`."""
    processes: dict[str, tuple[float, float]]
    """CPU seconds and peak memory in MB of "plant" and of each joint's process; empty in the
    twin. Of a joint that had several boards: seconds of all, memory of the largest."""
    clocks_shared: bool
    """Whether all processes read one clock, so that a frame's way can be timed."""
    realtime: RealtimeTimes | None = None
    """How boards kept their time, of a run in realtime. Then `links` is empty: frames have no
    tick in which they ought to be heard, and so no fate; and boards tell of turns, not of ticks."""


def a_tick_later(arrived_ns: Integers) -> Integers:
    """By the tick in which a frame was said, what is known by the tick in which it is used."""
    return np.append(arrived_ns[1:], 0)
