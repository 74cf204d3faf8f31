"""What the plant is told: its part of the resolved scenario, as typed values."""

from typing import Any, NamedTuple

from plant_server.body.body import Spring
from plant_server.body.chain import LinkInertia
from plant_server.hardware.data_sheets import FootSheet, MotorSheet
from protocol.robot.cadence import Cadence, cadence_of
from protocol.robot.clocks import ClockSheet, clock_sheet
from protocol.robot.commands import PERFECT, Command, LinkParameters, changed
from protocol.robot.sensors import SensorName, SensorSheet, sensors_of


class Unattended(NamedTuple):
    """What a joint without a board does (S17)."""

    how: str
    """"limp", "braked" or "passive"."""
    stiffness_nm_rad: float
    damping_nm_s_rad: float


class PlantConfig(NamedTuple):
    """The body and the run."""

    joints: tuple[str, ...]
    segments: tuple[str, ...]
    """Names of the links."""
    links: tuple[LinkInertia, ...]
    initial_angles_rad: tuple[float, ...]
    imu: tuple[bool, ...]
    force_plate: tuple[bool, ...]
    torque_limits_nm: tuple[float, ...]
    references_rad: tuple[float, ...]
    unattended: tuple[Unattended, ...]
    standing_links: dict[tuple[int, int], LinkParameters]
    """Parameters, other than perfect ones, of directed links (sender, receiver)."""
    events: tuple[tuple[int, Command], ...]
    """What the scenario does to the robot, and in which tick."""
    tick_s: float
    substeps: int
    ticks: int
    fallen_below: float
    """Fraction of the upright height of the centre of mass."""
    warm_up_ticks: int
    cadence: Cadence | None = None
    """None: lockstep."""
    seed: int = 0
    """Of all noise."""
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


def plant_config(values: dict[str, Any]) -> PlantConfig:
    """Read the plant's part of the values of a resolved scenario."""
    run, boards = values["run"], values["board"]
    orientations = [board["initial_rad"] for board in boards]
    below = [0.0, *orientations[:-1]]
    cadence, foot = cadence_of(values), boards[0]["foot"]
    warm_up_ticks = max(board["lumped_delay_ticks"] for board in boards)
    return PlantConfig(
        joints=tuple(board["joint"] for board in boards),
        segments=tuple(values["link_names"]),
        links=tuple(LinkInertia(**board["link"]) for board in boards),
        initial_angles_rad=tuple(a - b for a, b in zip(orientations, below, strict=True)),
        imu=tuple(board["imu"] for board in boards),
        force_plate=tuple(board["force_plate"] for board in boards),
        torque_limits_nm=tuple(board["servo"]["torque_limit_nm"] for board in boards),
        references_rad=tuple(board["reference_rad"] for board in boards),
        unattended=tuple(Unattended(**board["unattended"]) for board in boards),
        standing_links={
            (sender, receiver): changed(PERFECT, changes)
            for sender, receiver, changes in values["link"]
        },
        events=tuple((tick, command) for tick, command in values["event"]),
        tick_s=run["tick_s"],
        substeps=run["substeps"],
        ticks=run["ticks"],
        fallen_below=run["fallen_below"],
        warm_up_ticks=warm_up_ticks + (cadence.settle_ticks if cadence else 0),
        cadence=cadence,
        seed=run["seed"],
        sensors=tuple(
            sensors_of(
                imu=board["imu"],
                force_plate=board["force_plate"],
                differentiates=board["sensors"]["differentiates"],
            )
            for board in boards
        ),
        sensor_sheets=tuple(SensorSheet(**board["sensors"]) for board in boards),
        clock_sheets=tuple(_clock(board["clock"], cadence) for board in boards),
        motor_sheets=tuple(MotorSheet(**board["actuator"]) for board in boards),
        passive=tuple(_passive(board["passive"]) for board in boards),
        foot=None if foot is None else FootSheet(**foot),
    )


def _clock(values: dict[str, Any], cadence: Cadence | None) -> ClockSheet:
    """In realtime boards have clocks, and the plant makes none up."""
    sheet = clock_sheet(values)
    return sheet if cadence is None else sheet._replace(skew_ppm=0.0)


def _passive(values: dict[str, float]) -> Spring | None:
    spring = Spring(**values)
    return spring if spring.stiffness_nm_rad or spring.damping_nm_s_rad else None
