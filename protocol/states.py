"""What a board can be doing, and what it counts: numbers in its torque frame."""

from enum import IntEnum

from protocol.frames import Reason


class State(IntEnum):
    """Firmware state of a board."""

    SYNCING = 1
    """Fills its delay line; its torque is 0."""
    RUNNING = 2
    """Drives its joint on complete samples."""
    HOLDING = 3
    """Drives on the newest older sample (S9)."""
    EXTRAPOLATING = 4
    """Drives on samples extrapolated by their rates (S9)."""
    RECKONING = 5
    """Takes what lies above for rigid, and its orientation from the foot up (S9)."""
    SAFE = 6
    """Its sensors have said nothing plausible for too long: no torque, and not enabled."""


COUNTERS = (
    "held_ticks",
    "extrapolated_ticks",
    "reckoned_ticks",
    "implausible_samples",
    "incomplete_epochs",
    *(f"refused_{reason}" for reason in Reason),
    "inconsistent_samples",
    "stuck_samples",
)
"""Telemetry: a torque frame carries one of these, the next tick the next, and so on around. Numbers
keep their meaning: new ones come behind."""
