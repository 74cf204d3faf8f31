"""Timing: the frame in which a board tells when it did what, on its clock.

It is for the recording alone: a board may leave it out, and nothing that happens to the robot
depends on it. How long a frame was under way is its arrival less `decided_us` of its sender in the
tick before, where both read the same clock.
"""

from typing import NamedTuple


class TickTiming(NamedTuple):
    """One tick of a board, in microseconds after the frame's `base_ns`."""

    taken_up_us: int
    """The observation was read."""
    decided_us: int
    """The tick was thought through, and the board began to speak."""
    said_us: int
    """The last frame, the torque, was put."""
    first_arrived_us: int
    """What the first neighbour (from the ground up) said in the tick before was here; -1: never."""
    second_arrived_us: int
    """The same of the second neighbour; -1 also where there is none."""


class Timing(NamedTuple):
    """Board to a plant that records, every few ticks: when it did what. Nothing waits for it."""

    run_id: int
    incarnation: int
    tick: int
    """The first of `ticks`, which follow each other without gaps."""
    base_ns: int
    """A reading of the board's monotonic clock."""
    clock: int
    """Boards with the same number read the same monotonic clock; 0: unknown."""
    cpu_us: int
    """Processor time of the board's process so far."""
    memory_kb: int
    """The most memory that it has had resident."""
    ticks: tuple[TickTiming, ...]
