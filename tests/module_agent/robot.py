"""A robot of three real boards for tests: sensors scripted, every frame heard in the next tick."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, sin
from typing import Any

from msgspec import structs

from module_agent.assembly import assemble
from module_agent.firmware.board import Actuation, Board
from module_agent.firmware.config import BoardConfig, ElectionConfig
from protocol.robot.events import PERFECT
from protocol.robot.hardware import Link, ServoGains
from protocol.robot.scenario import Controls
from protocol.robot.sensors import Readings
from protocol.wire.frames import (
    NO_TICK,
    LinkFrame,
    Neighbour,
    Observation,
    TorqueFrame,
    decode,
    encode,
)
from protocol.wire.wiring import neighbours

RUN = 2**31 + 7
DELAY_TICKS = 10
PERIOD_TICKS = 40
ROUNDS = 2
JOINTS = ("ankle", "knee", "hip")
CONTROLS = (Controls.BODY_SWAY, Controls.JOINT_ANGLE, Controls.LINK_ORIENTATION)
THIGH = Link(10.0, 0.5, 0.25, 0.2)
TRUNK = Link(30.0, 0.5, 0.25, 0.6)
LINKS = (THIGH, THIGH, TRUNK)
PROPORTIONAL = ServoGains(
    kp_nm_rad=100.0,
    kd_nm_s_rad=0.0,
    ki_nm_rad_s=0.0,
    g_servo=1.0,
    gravity_weight=0.0,
    torque_limit_nm=1e6,
)
"""Torque is -100 times the error, so it shows which error the servo took."""
FULL = structs.replace(PROPORTIONAL, kd_nm_s_rad=20.0, ki_nm_rad_s=5.0, gravity_weight=0.8)

Sensors = Callable[[int, int], Readings]
"""Board and tick to what the board senses."""
UNSENSED = Readings(*(0.0,) * len(Readings._fields))


def config(index: int, gains: ServoGains = FULL, **changes: Any) -> BoardConfig:
    whole = BoardConfig(
        joint=JOINTS[index],
        index=index,
        boards=3,
        seed=1,
        standing_links=(PERFECT,) * len(neighbours(index, 3)),
        neighbours=neighbours(index, 3),
        neighbour_joints=tuple(JOINTS[i] for i in neighbours(index, 3)),
        top=index == 2,
        tick_s=0.001,
        controls=CONTROLS[index],
        reference_rad=0.0,
        holds_orientation=False,
        lumped_delay_ticks=DELAY_TICKS,
        gains=gains,
        link=LINKS[index],
        has_imu=index == 2,
        has_force_plate=index == 0,
        election=ElectionConfig(PERIOD_TICKS, ROUNDS, keeps_last=False),
    )
    return replace(whole, **changes)


def board(index: int, gains: ServoGains = FULL, **changes: Any) -> Board:
    return assemble(config(index, gains, **changes), run_id=RUN, incarnation=1)


def moving(index: int, tick: int) -> Readings:
    """Sensors of a body whose every joint moves in its own way, at the rate that it says."""
    joint = 0.1 * sin(0.03 * tick + index), 3.0 * cos(0.03 * tick + index)
    imu = (0.2 * sin(0.02 * tick), 4.0 * cos(0.02 * tick)) if index == 2 else (0.0, 0.0)
    foot = (490.0 + index, 0.01) if index == 0 else (0.0, 0.0)
    return Readings(*joint, 1.0, *imu, *foot)


def still(index: int, _tick: int) -> Readings:
    """Sensors of a body that stands still in a bow; the trunk is furthest from its reference."""
    return UNSENSED._replace(joint_rad=(-0.07, -0.07, 0.7)[index], imu_rad=(0.0, 0.0, 0.56)[index])


def observation(
    index: int, tick: int, sensors: Sensors = moving, waits: int = 1, command: bytes = b""
) -> bytes:
    completed = NO_TICK if tick == -DELAY_TICKS else tick - 1
    roster = tuple(Neighbour(1, completed, waits) for _ in neighbours(index, 3))
    return encode(Observation(RUN, 1, tick, sensors(index, tick), command, roster))


class Robot:
    """Three boards, their sensors scripted, every frame heard in the next tick."""

    def __init__(
        self, *, gains: ServoGains = FULL, sensors: Sensors = moving, **changes: Any
    ) -> None:
        self.boards = [board(index, gains, **changes) for index in range(3)]
        self.sensors = sensors
        self.heard: list[list[tuple[int, int, bytes]]] = []
        """Of each tick: receiver, its link, frame."""

    def tick(self, tick: int, commands: dict[int, bytes] | None = None) -> list[Actuation]:
        given = commands or {}
        acts = [
            one.tick(
                one.read(observation(index, tick, self.sensors, command=given.get(index, b"")))
            )
            for index, one in enumerate(self.boards)
        ]
        frames = [
            (near, neighbours(near, 3).index(index), payload)
            for index, act in enumerate(acts)
            for near, payload in zip(neighbours(index, 3), act.links, strict=True)
        ]
        for receiver, link, payload in frames:
            self.boards[receiver].hear(link, payload)
        self.heard.append(frames)
        return acts

    def run(self, until: int) -> dict[int, list[Actuation]]:
        return {tick: self.tick(tick) for tick in range(-DELAY_TICKS, until)}


def torque(act: Actuation) -> TorqueFrame:
    return decode(TorqueFrame, act.torque)


def link(act: Actuation, place: int = 0) -> LinkFrame:
    return decode(LinkFrame, act.links[place])
