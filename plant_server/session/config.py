"""What the plant is told: its part of the resolved scenario, as typed values."""

from typing import NamedTuple

from msgspec.structs import replace

from plant_server.body.body import Spring
from protocol.robot.cadence import Cadence, cadence_of
from protocol.robot.events import Command, LinkParameters
from protocol.robot.hardware import (
    ClockSheet,
    FootSheet,
    Link,
    MotorSheet,
    PassiveElement,
    UnattendedJoint,
)
from protocol.robot.scenario import RunSettings, Scenario
from protocol.robot.sensors import SensorName, SensorSheet


class PlantConfig(NamedTuple):
    """The body and the run."""

    joints: tuple[str, ...]
    segments: tuple[str, ...]
    """Names of the links."""
    links: tuple[Link, ...]
    initial_angles_rad: tuple[float, ...]
    torque_limits_nm: tuple[float, ...]
    references_rad: tuple[float, ...]
    unattended: tuple[UnattendedJoint, ...]
    standing_links: dict[tuple[int, int], LinkParameters]
    """Parameters, other than perfect ones, of directed links (sender, receiver)."""
    events: tuple[tuple[int, Command], ...]
    """What the scenario does to the robot, and in which tick."""
    run: RunSettings
    warm_up_ticks: int
    cadence: Cadence | None = None
    """None: lockstep."""
    sensors: tuple[tuple[SensorName, ...], ...] = ()
    """Names of the sensors of each board."""
    sensor_sheets: tuple[SensorSheet, ...] = ()
    clock_sheets: tuple[ClockSheet, ...] = ()
    motor_sheets: tuple[MotorSheet, ...] = ()
    """Of each board; empty: everything is ideal."""
    passive: tuple[Spring | None, ...] = ()
    """The joints' own springs and dampers."""
    foot: FootSheet | None = None
    """None: the ground takes any torque."""


def plant_config(scenario: Scenario) -> PlantConfig:
    """What of a scenario the plant has to know."""
    run, boards, cadence = scenario.run, scenario.boards, cadence_of(scenario)
    orientations = [board.initial_rad for board in boards]
    below = [0.0, *orientations[:-1]]
    warm_up_ticks = max(board.lumped_delay_ticks for board in boards)
    return PlantConfig(
        joints=tuple(scenario.joints),
        segments=scenario.link_names,
        links=tuple(board.link for board in boards),
        initial_angles_rad=tuple(a - b for a, b in zip(orientations, below, strict=True)),
        torque_limits_nm=tuple(board.servo.torque_limit_nm for board in boards),
        references_rad=tuple(board.reference_rad for board in boards),
        unattended=tuple(board.unattended for board in boards),
        standing_links=scenario.standing_links,
        events=tuple((event.tick, event.command) for event in scenario.events),
        run=run,
        warm_up_ticks=warm_up_ticks + (cadence.settle_ticks if cadence else 0),
        cadence=cadence,
        sensors=tuple(board.sensor_names for board in boards),
        sensor_sheets=tuple(board.sensors for board in boards),
        clock_sheets=tuple(_clock(board.clock, cadence) for board in boards),
        motor_sheets=tuple(board.actuator for board in boards),
        passive=tuple(_spring(board.passive) for board in boards),
        foot=boards[0].foot,
    )


def _clock(sheet: ClockSheet, cadence: Cadence | None) -> ClockSheet:
    """In realtime boards have clocks, and the plant makes none up."""
    return sheet if cadence is None else replace(sheet, skew_ppm=0.0)


def _spring(of: PassiveElement) -> Spring | None:
    """What acts in the joint itself; None: nothing does."""
    if not (of.stiffness_nm_rad or of.damping_nm_s_rad):
        return None
    return Spring(of.rest_rad, of.stiffness_nm_rad, of.damping_nm_s_rad)
