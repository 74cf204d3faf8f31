"""What a terminal can ask of a running robot: how it is, and to do something to it. Pure.

Rule: a command that cannot take effect is refused with its reason; one that can is on the agenda
for the next tick, and the answer says for which.
"""

import json
from typing import Any, assert_never
from zlib import compress

from plant_server.session.free_running import FreeRunning
from plant_server.session.lockstep import Lockstep
from plant_server.session.plant import Plant
from plant_server.session.watch import PlantWatch
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
    driver: Lockstep | FreeRunning,
    joints: list[str],
    payload: bytes,
    watch: PlantWatch | None = None,
) -> bytes:
    """Answer a request `[version, "status"]` or `[version, command]` with a JSON object."""
    reply: dict[str, Any]
    try:
        version, request = unseal(payload)
        if version != VERSION:
            reply = {"refused": f"this plant speaks version {VERSION}, not {str(version)[:20]}"}
        elif request == STATUS:
            reply = status(driver, watch or PlantWatch(joints))
        else:
            command = command_of(json.loads(request))
            check_event(command, joints)
            reply = {"tick": _schedule(driver.plant, joints, command)}
    except (ProtocolError, ValueError, TypeError) as error:
        reply = {"refused": str(error)}
    return compress(json.dumps(reply).encode())


def status(driver: Lockstep | FreeRunning, watch: PlantWatch) -> dict[str, Any]:
    """How the robot is, in words and numbers."""
    plant, joints = driver.plant, watch.joints
    waiting_for = driver.waiting_for if isinstance(driver, Lockstep) else []
    found = {
        "tick": plant.tick,
        "tick_s": plant.config.run.tick_s,
        "segments": list(plant.config.segments),
        "waits_for": [joints[board] for board in waiting_for],
        "sides": [[joints[board] for board in side] for side in plant.roster.sides()],
        "boards": [_board(plant, watch, board) for board in range(len(joints))],
        "sensor_faults": [
            {"joint": joint, "sensor": sensor, "fault": fault}
            for board, joint in enumerate(joints)
            for sensor, fault in plant.sensors.faults(board, plant.tick).items()
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
                "one_way": _is_deaf(plant, sender, receiver),
            }
            for (sender, receiver), now in plant.roster.links.items()
        ],
        "storms": [storm._asdict() for storm in watch.storms.raging],
    }
    if isinstance(driver, FreeRunning):
        found["realtime"] = _realtime(driver, joints)
    return found


def _realtime(running: FreeRunning, joints: list[str]) -> list[dict[str, Any]]:
    """How each board keeps its deadlines, and how old its torque is."""
    plant = running.plant
    return [
        {
            "joint": joint,
            "rate_hz": 1.0 / (period * plant.config.run.tick_s),
            "periods": tally.periods,
            "missed": tally.missed,
            "late_ms_max": tally.late_us_max / 1e3,
            "torque_age_ticks": None if latest is None else plant.tick - said_tick,
            "stale_ticks": stale,
        }
        for joint, period, tally, latest, said_tick, stale in zip(
            joints,
            running.cadence.ticks_per_period,
            running.tallies,
            plant.latest,
            running.said_ticks,
            running.stale_ticks,
            strict=True,
        )
    ]


def _board(plant: Plant, watch: PlantWatch, board: int) -> dict[str, Any]:
    latest, failure = plant.latest[board], plant.telemetry.failures[board]
    about: dict[str, Any] = {
        "joint": watch.joints[board],
        "incarnation": plant.roster.incarnations[board],
        "state": _state(plant, watch, board),
        "enabled": latest is not None and bool(latest.enabled),
        "fault": None
        if failure is None
        else {"code": failure.code, "name": failure.code.title, "text": failure.text},
        "stuck": watch.stuck[board],
        "counters": plant.telemetry.counters(board)._asdict(),
    }
    if latest is not None:
        about |= {"torque_nm": latest.torque_nm, "controlled_rad": latest.controlled_rad}
    return about


def _state(plant: Plant, watch: PlantWatch, board: int) -> str:
    """A firmware state by its name, or "absent": nobody is there, as far as the plant knows."""
    latest = plant.latest[board]
    if latest is not None:
        return State(latest.state).name.lower()
    here = plant.roster.present(board) or board in watch.enrolled
    return State.ENROLLING.name.lower() if here else ABSENT


def _is_deaf(plant: Plant, sender: int, receiver: int) -> bool:
    """Whether the sender finds that the receiver has not heard it for long."""
    frame = plant.latest[sender]
    if frame is None or plant.latest[receiver] is None:
        return False
    link = sorted(other for other in (sender - 1, sender + 1) if 0 <= other < plant.size)
    return frame.links[link.index(receiver)].unheard_ticks > ONE_WAY_AFTER_TICKS


def _schedule(plant: Plant, joints: list[str], command: Command) -> int:
    """Put a command on the agenda, and return the tick in which its turn will come."""
    tick = plant.tick + 1
    turn = plant.agenda.turn(tick)
    if turn >= plant.config.run.ticks:
        raise EventError(f"the run is over at tick {plant.config.run.ticks}")
    _check_effect(plant, joints, command)
    plant.agenda.add(tick, command)
    return turn


def _check_effect(plant: Plant, joints: list[str], command: Command) -> None:
    if isinstance(command, LinkCommand | Disturbance):
        return
    board, roster = command.board, plant.roster
    match command:
        case Unplug() | ReferenceChange():
            if not roster.present(board):
                raise EventError(f"{joints[board]} is not plugged in")
        case SensorFault(sensor=sensor):
            if sensor not in (*plant.config.sensors[board], ALL):
                raise EventError(f"{joints[board]} has no {sensor}")
        case Plug():
            if plant.start_up.under_way(board):
                raise EventError(f"{joints[board]} is starting up already")
            if roster.present(board):
                raise EventError(f"{joints[board]} is plugged in already")
        case _:
            assert_never(command)
