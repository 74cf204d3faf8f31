"""Commands: what may be done to a running robot, by a scenario or from a terminal.

Rule 1: the plant puts commands in order, at most one a tick, and hands them out with the
        observations. So every board obeys in the same tick, and a run can be played again (S15).
Rule 2: a command is checked before it is accepted; one that cannot take effect is refused.

A command is a plain list, the same in a resolved scenario, on the wire and in a recording:

    ["link", pairs, {parameter: value}]   change directed links: [[sender, receiver], ...]; []: all
    ["heal", pairs]                       make them perfect again
    ["reference", board, rad]             give a board another reference
    ["push", link, force_n, ticks]        push a link at its centre of mass, forward
    ["sensor", board, sensor, fault, amount, ticks]
                                          a sensor fails (`robot.sensors`); ticks 0: for good
    ["unplug", board]  ["plug", board]    take a board away, put one in

What concerns a board reaches it as a `BoardCommand` inside its observation.
"""

import math
from typing import Any, NamedTuple

import msgpack

from protocol.robot import sensors

ANY = -1
DELAY_TICKS_MAX = 31
"""Delay and jitter together stay below 63, so that what a tick heard fits into one number."""
RAD_MAX = 3.2
"""A reference of more than half a turn is a mistake."""
FORCE_N_MAX = 1e4
PUSH_TICKS_MAX = 10**7
"""How long a push or the fault of a sensor can last."""

Command = list[Any]


class CommandError(Exception):
    """A command that cannot take effect; says why."""


class LinkParameters(NamedTuple):
    """How bad a directed link is; probabilities are per frame."""

    loss: float = 0.0
    burst_start: float = 0.0
    """Gilbert-Elliott: probability of changing from good to bad before a frame."""
    burst_end: float = 1.0
    """Gilbert-Elliott: probability of changing from bad to good before a frame."""
    burst_loss: float = 1.0
    """Probability of loss in the bad state, on top of `loss`."""
    delay_ticks: float = 0.0
    jitter_ticks: float = 0.0
    """A frame is late by `delay_ticks` and up to so many more, all equally likely."""
    duplicate: float = 0.0
    reorder: float = 0.0
    """Probability that a frame is held back for one tick more, so that the next overtakes it."""
    corrupt: float = 0.0
    """Probability that a bit is flipped on the way."""
    cut: float = 0.0
    """1: nothing arrives."""


PERFECT = LinkParameters()
TICKS = frozenset({"delay_ticks", "jitter_ticks"})
WHOLE = TICKS | {"cut"}


class BoardCommand(NamedTuple):
    """A command as a board gets it: a new set of link parameters, or a new reference."""

    kind: int
    sender: int
    """The neighbour whose frames are meant, or `ANY`."""
    values: tuple[float, ...]
    """`LINK`: all link parameters in order; `REFERENCE`: radians."""


LINK, REFERENCE = 1, 2
_VALUES = {LINK: len(LinkParameters._fields), REFERENCE: 1}


def encode_board_command(command: BoardCommand) -> bytes:
    """Write it for an observation: `[kind, sender, value, ...]`, without a CRC of its own."""
    packed: bytes = msgpack.packb((command.kind, command.sender, *command.values))
    return packed


def decode_board_command(payload: bytes) -> BoardCommand | None:
    """Read it; None if it is not one, or none that a link or a board can obey."""
    try:
        kind, sender, *values = msgpack.unpackb(payload)
    except (ValueError, TypeError, OverflowError, msgpack.UnpackException):
        return None
    if type(kind) is not int or type(sender) is not int or len(values) != _VALUES.get(kind):
        return None
    if sender < ANY or not all(type(value) is float for value in values):
        return None
    if kind == LINK:
        possible = all(map(_is_possible, LinkParameters._fields, values))
    else:
        possible = abs(values[0]) <= RAD_MAX
    return BoardCommand(kind, sender, tuple(values)) if possible else None


def check_command(command: Command, joints: list[str]) -> None:
    """Raise `CommandError` if a robot with these joints cannot carry it out."""
    match command:
        case ["link", list(pairs), dict(changes)]:
            _check_pairs(pairs, joints)
            _check_changes(changes)
        case ["heal", list(pairs)]:
            _check_pairs(pairs, joints)
        case ["reference", int(board), float(rad)]:
            _check_board(board, joints)
            if not abs(rad) <= RAD_MAX:
                most_deg = math.degrees(RAD_MAX)
                raise CommandError(
                    f"a reference of {math.degrees(rad):g}° is beyond {most_deg:.0f}°"
                )
        case ["push", int(link), float(force_n), int(ticks)]:
            _check_board(link, joints)
            if not abs(force_n) <= FORCE_N_MAX:
                raise CommandError(f"a force of {force_n} N is beyond {FORCE_N_MAX:g} N")
            if isinstance(ticks, bool) or not 1 <= ticks <= PUSH_TICKS_MAX:
                raise CommandError(f"a push lasts 1 to {PUSH_TICKS_MAX} ticks, not {ticks}")
        case ["sensor", int(board), str(sensor), str(fault), float(amount), int(ticks)]:
            _check_board(board, joints)
            _check_fault(sensor, fault, amount, ticks)
        case ["unplug" | "plug", int(board)]:
            _check_board(board, joints)
        case _:
            raise CommandError(f"not a command: {str(command)[:80]}")


def changed(parameters: LinkParameters, changes: dict[str, float]) -> LinkParameters:
    """Return link parameters with some of them changed."""
    return parameters._replace(**{name: float(value) for name, value in changes.items()})


def concerns(command: Command, sender: int, receiver: int) -> bool:
    """Whether a "link" or "heal" command is about this directed link."""
    return not command[1] or [sender, receiver] in command[1]


def _check_board(board: int, joints: list[str]) -> None:
    if isinstance(board, bool) or not 0 <= board < len(joints):
        raise CommandError(f"there is no board {board}; the body has {', '.join(joints)}")


def _check_fault(sensor: str, fault: str, amount: float, ticks: int) -> None:
    if sensor not in sensors.FAULTABLE:
        known = ", ".join(sensors.FAULTABLE)
        raise CommandError(f"no sensor is called {sensor[:40]!r}; there are {known}")
    kind = sensors.fault_kind(fault)
    if kind is None:
        known = ", ".join(sensors.FAULTS)
        raise CommandError(f"a sensor cannot be {fault[:40]!r}, but {known}")
    trouble = sensors.amount_trouble(kind, amount)
    if trouble is not None:
        raise CommandError(trouble)
    if isinstance(ticks, bool) or not 0 <= ticks <= PUSH_TICKS_MAX:
        raise CommandError(f"a fault lasts 0 to {PUSH_TICKS_MAX} ticks, not {ticks}")


def _check_pairs(pairs: list[Any], joints: list[str]) -> None:
    for pair in pairs:
        match pair:
            case [int(sender), int(receiver)]:
                _check_board(sender, joints)
                _check_board(receiver, joints)
            case _:
                raise CommandError(f"not a link: {str(pair)[:40]}")
        if abs(sender - receiver) != 1:
            raise CommandError(f"{joints[sender]} and {joints[receiver]} have no link")


def _check_changes(changes: dict[str, float]) -> None:
    if not changes:
        raise CommandError("no parameter of the link is given")
    for name, value in changes.items():
        _check_parameter(name, value)


def _check_parameter(name: str, value: float) -> None:
    if name not in LinkParameters._fields:
        known = ", ".join(LinkParameters._fields)
        raise CommandError(f"a link has no {name!r}; it has {known}")
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise CommandError(f"{name} must be a number, not {value!r}")
    if not _is_possible(name, value):
        raise CommandError(
            f"{name} must be {'whole and ' if name in WHOLE else ''}from 0 to {_most(name)}"
        )


def _most(name: str) -> int:
    return DELAY_TICKS_MAX if name in TICKS else 1


def _is_possible(name: str, value: float) -> bool:
    """Whether a link can have a parameter of this value; it cannot have a NaN."""
    return 0 <= value <= _most(name) and (name not in WHOLE or value == int(value))
