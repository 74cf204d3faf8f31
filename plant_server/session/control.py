"""What a terminal can ask of a running robot: how it is, and to do something to it. Pure.

Rule: a command that cannot take effect is refused with its reason; one that can is on the agenda
for the next tick, and the answer says for which.
"""

import json
from typing import Any, assert_never
from zlib import compress

from plant_server.session.free_running import FreeRunning
from plant_server.session.lockstep import Lockstep
from plant_server.session.watch import Watch
from protocol.robot.events import (
    PERFECT,
    Command,
    Disturbance,
    EventError,
    LinkCommand,
    Plug,
    ReferenceChange,
    SensorFault,
    Unplug,
    check_event,
    command_of,
)
from protocol.robot.sensors import ALL
from protocol.robot.states import State
from protocol.wire.frames import VERSION, ProtocolError, unseal

STATUS = "status"
ABSENT = "absent"
ONE_WAY_AFTER_TICKS = 100
"""A neighbour that has heard nothing for so long, while it is heard, hears nothing at all; no delay
of a link is that long."""


def answer(
    lockstep: Lockstep, joints: list[str], payload: bytes, watch: Watch | None = None
) -> bytes:
    """Answer a request `[version, "status"]` or `[version, command]` with a JSON object."""
    reply: dict[str, Any]
    try:
        version, request = unseal(payload)
        if version != VERSION:
            reply = {"refused": f"this plant speaks version {VERSION}, not {str(version)[:20]}"}
        elif request == STATUS:
            reply = status(lockstep, watch or Watch(joints))
        else:
            command = command_of(json.loads(request))
            check_event(command, joints)
            reply = {"tick": _schedule(lockstep, joints, command)}
    except (ProtocolError, ValueError, TypeError) as error:
        reply = {"refused": str(error)}
    return compress(json.dumps(reply).encode())


def status(lockstep: Lockstep, watch: Watch) -> dict[str, Any]:
    """How the robot is, in words and numbers."""
    roster, joints = lockstep.roster, watch.joints
    found = {
        "tick": lockstep.tick,
        "tick_s": lockstep.config.tick_s,
        "segments": list(lockstep.config.segments),
        "waits_for": [joints[board] for board in lockstep.waiting_for],
        "sides": [[joints[board] for board in side] for side in roster.sides()],
        "boards": [_board(lockstep, watch, board) for board in range(len(joints))],
        "sensor_faults": [
            {"joint": joint, "sensor": sensor, "fault": fault}
            for board, joint in enumerate(joints)
            for sensor, fault in lockstep.sensors.faults(board, lockstep.tick).items()
        ],
        "links": [
            {
                "from": joints[sender],
                "to": joints[receiver],
                "faults": {
                    name: value
                    for name, value in now._asdict().items()
                    if value != getattr(PERFECT, name)
                },
                "one_way": _is_deaf(lockstep, sender, receiver),
            }
            for (sender, receiver), now in roster.links.items()
        ],
        "storms": [storm._asdict() for storm in watch.storms.raging],
    }
    if isinstance(lockstep, FreeRunning):
        found["realtime"] = _realtime(lockstep, joints)
    return found


def _realtime(plant: FreeRunning, joints: list[str]) -> list[dict[str, Any]]:
    """How each board keeps its deadlines, and how old its torque is."""
    return [
        {
            "joint": joint,
            "rate_hz": 1.0 / (period * plant.config.tick_s),
            "periods": tally.periods,
            "missed": tally.missed,
            "late_ms_max": tally.late_us_max / 1e3,
            "torque_age_ticks": None if latest is None else plant.tick - said_tick,
            "stale_ticks": stale,
        }
        for joint, period, tally, latest, said_tick, stale in zip(
            joints,
            plant.cadence.ticks_per_period,
            plant.tallies,
            plant.latest,
            plant.said_ticks,
            plant.stale_ticks,
            strict=True,
        )
    ]


def _board(lockstep: Lockstep, watch: Watch, board: int) -> dict[str, Any]:
    latest, failure = lockstep.latest[board], lockstep.telemetry.failures[board]
    about: dict[str, Any] = {
        "joint": watch.joints[board],
        "incarnation": lockstep.roster.incarnations[board],
        "state": _state(lockstep, watch, board),
        "enabled": latest is not None and bool(latest.enabled),
        "fault": None
        if failure is None
        else {"code": failure.code, "name": failure.code.title, "text": failure.text},
        "stuck": watch.stuck[board],
        "counters": lockstep.telemetry.counters(board)._asdict(),
    }
    if latest is not None:
        about |= {"torque_nm": latest.torque_nm, "controlled_rad": latest.controlled_rad}
    return about


def _state(lockstep: Lockstep, watch: Watch, board: int) -> str:
    """A firmware state by its name, or "absent": nobody is there, as far as the plant knows."""
    latest = lockstep.latest[board]
    if latest is not None:
        return State(latest.state).name.lower()
    here = lockstep.roster.present(board) or board in watch.enrolled
    return State.ENROLLING.name.lower() if here else ABSENT


def _is_deaf(lockstep: Lockstep, sender: int, receiver: int) -> bool:
    """Whether the sender finds that the receiver has not heard it for long."""
    frame = lockstep.latest[sender]
    if frame is None or lockstep.latest[receiver] is None:
        return False
    link = sorted(other for other in (sender - 1, sender + 1) if 0 <= other < lockstep.size)
    return frame.links[link.index(receiver)].unheard_ticks > ONE_WAY_AFTER_TICKS


def _schedule(lockstep: Lockstep, joints: list[str], command: Command) -> int:
    """Put a command on the agenda, and return the tick in which its turn will come."""
    tick = lockstep.tick + 1
    turn = lockstep.agenda.turn(tick)
    if turn >= lockstep.config.ticks:
        raise EventError(f"the run is over at tick {lockstep.config.ticks}")
    _check_effect(lockstep, joints, command)
    lockstep.agenda.add(tick, command)
    return turn


def _check_effect(lockstep: Lockstep, joints: list[str], command: Command) -> None:
    if isinstance(command, LinkCommand | Disturbance):
        return
    board, roster = command.board, lockstep.roster
    match command:
        case Unplug() | ReferenceChange():
            if not roster.present(board):
                raise EventError(f"{joints[board]} is not plugged in")
        case SensorFault(sensor=sensor):
            if sensor not in (*lockstep.config.sensors[board], ALL):
                raise EventError(f"{joints[board]} has no {sensor}")
        case Plug():
            if lockstep.start_up.under_way(board):
                raise EventError(f"{joints[board]} is starting up already")
            if roster.present(board):
                raise EventError(f"{joints[board]} is plugged in already")
        case _:
            assert_never(command)
