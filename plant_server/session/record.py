"""What a run leaves behind: a record of every tick, and how it ended."""

from typing import NamedTuple

from protocol.robot.events import Event

COMPLETE = "complete"
FELL = "fell"
STOPPED = "stopped"
"""The endings of a run: it had its ticks, the body fell, it was told to stop."""


class TickRecord(NamedTuple):
    """One tick as it happened: state before it, torques applied in it, and what boards said."""

    tick: int
    angles_rad: tuple[float, ...]
    rates_rad_s: tuple[float, ...]
    torques_nm: tuple[float, ...]
    answers: tuple[bytes, ...]
    """Torque frames, from the ground up; empty where there was no board."""
    events: tuple[Event, ...]
    """Commands that took effect, boards that came, went and failed, verdicts."""


class TickWallTimes(NamedTuple):
    """When a tick happened, on the monotonic clock of the plant's machine."""

    opened_ns: int
    """Before the observations went out."""
    answered_ns: tuple[int, ...]
    """When the answer of each board was taken; 0: it did not answer."""
    closed_ns: int
    """After the last answer, before the body moved on."""


class UndrivenJoint(NamedTuple):
    """A joint that nobody drove when the run ended."""

    joint: str
    since_tick: int
    how: str
    """What it did meanwhile: "limp", "braked" or "passive"."""
    has_board: bool
    """A board had been put in, but had not driven yet."""


class Outcome(NamedTuple):
    """How a run ended: the state after its last tick, and why it was the last."""

    tick: int
    angles_rad: tuple[float, ...]
    rates_rad_s: tuple[float, ...]
    ending: str
    """`COMPLETE`, `FELL`, `STOPPED`, or why else it was cut short."""
    wall_s: float
    """Wall time from the release of the body to the end."""
    undriven: tuple[UndrivenJoint, ...] = ()


def fall_line(outcome: Outcome, tick_s: float) -> str:
    """When the body fell, and which joints nobody drove, in words."""
    told = [f"fell at {outcome.tick * tick_s:.2f} s"]
    for joint, since_tick, how, has_board in outcome.undriven:
        lacked = "not been driven" if has_board else "had no board"
        told.append(f"{joint} had {lacked} since {since_tick * tick_s:.2f} s and was {how}")
    return "; ".join(told)
