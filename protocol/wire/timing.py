"""Timing: the frame in which a board tells when it did what, on its clock.

It is for the recording alone: a board may leave it out, and nothing that happens to the robot
depends on it. How long a frame was under way is its arrival less `decided_us` of its sender in the
tick before, where both read the same clock.
"""

from typing import Annotated, NamedTuple

from protocol.wire.fields import field

INT64_MAX = 2**63 - 1
"""What is recorded can be read by whoever has 64 bits."""
NOT_HEARD = -1


class TickTiming(NamedTuple):
    """One tick of a board, in microseconds after the frame's `base_ns`."""

    taken_up_us: Annotated[
        int, field("when the observation was read, after `base_ns`", unit="µs", ge=0, le=INT64_MAX)
    ]
    decided_us: Annotated[
        int,
        field(
            "when the tick was thought through and the first frame about to be put",
            unit="µs",
            ge=0,
            le=INT64_MAX,
        ),
    ]
    said_us: Annotated[
        int,
        field("when the last frame, the torque, had been put", unit="µs", ge=0, le=INT64_MAX),
    ]
    first_arrived_us: Annotated[
        int,
        field(
            "when the frame arrived that the first neighbour sent in the tick before; -1: none",
            unit="µs",
            ge=NOT_HEARD,
            le=INT64_MAX,
        ),
    ]
    second_arrived_us: Annotated[
        int,
        field(
            "the same of the second neighbour; -1 also where there is none",
            unit="µs",
            ge=NOT_HEARD,
            le=INT64_MAX,
        ),
    ]


class Timing(NamedTuple):
    """When a board did what in some ticks, on its own monotonic clock, and what it has used."""

    run_id: Annotated[int, field("the run, as granted at enrolment")]
    incarnation: Annotated[int, field("of the sender")]
    tick: Annotated[
        int, field("of the first entry; the others are of the ticks that follow, without gaps")
    ]
    base_ns: Annotated[
        int, field("a reading of the board's monotonic clock", unit="ns", ge=0, le=INT64_MAX)
    ]
    clock: Annotated[
        int,
        field(
            "names that clock, in 32 bits: two boards with the same number, but 0, read the same"
            " clock; 0: unknown",
            ge=0,
            le=INT64_MAX,
        ),
    ]
    cpu_us: Annotated[
        int, field("processor time of the board's process so far", unit="µs", ge=0, le=INT64_MAX)
    ]
    memory_kb: Annotated[
        int, field("the most memory that it has had resident", unit="KiB", ge=0, le=INT64_MAX)
    ]
    ticks: Annotated[
        tuple[TickTiming, ...], field("at least one, and no more than fit into the frame")
    ]
