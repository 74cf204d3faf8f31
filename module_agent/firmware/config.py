"""What a board is told at boot: one entry of the resolved scenario, as typed values."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from module_agent.firmware.kinematics import Link
from protocol.robot.cadence import Cadence, cadence_of
from protocol.robot.clocks import STEADY, ClockSheet, clock_sheet
from protocol.robot.commands import PERFECT, LinkParameters, changed
from protocol.robot.sensors import EXACT, SensorSheet
from protocol.wire.wiring import neighbours


class Controls(StrEnum):
    """The controlled variable alpha of a module (paper, section III-B)."""

    BODY_SWAY = "body-sway"
    """Sway of the centre of mass of all above the joint (the ankle's BS)."""
    JOINT_ANGLE = "joint-angle"
    """Angle of the joint itself (KNEE)."""
    LINK_ORIENTATION = "link-orientation"
    """Orientation in space of the link above the joint (the hip's TS)."""


class ServoGains(NamedTuple):
    """Gains of one module: the paper's table I, and what it leaves out (gravity weight, K_i)."""

    kp_nm_rad: float
    kd_nm_s_rad: float
    ki_nm_rad_s: float
    g_servo: float
    gravity_weight: float
    torque_limit_nm: float


class ElectionConfig(NamedTuple):
    """When boards elect, and what they do when they have not heard from everybody."""

    period_ticks: int
    rounds: int
    keeps_last: bool


class Source(NamedTuple):
    """A class in somebody's own file."""

    reference: str
    """As the scenario has it, such as `my_module:MyServo`."""
    path: str
    """Of the file, on this machine."""
    sha256: str
    """Of the file's bytes, in hex."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardConfig:
    """One board: who it is, its own link, its sensors, its servo."""

    joint: str
    index: int
    """Position in the chain, the joint on the ground being 0."""
    boards: int
    """How many boards the body has."""
    seed: int
    """Of the faults of its links."""
    standing_links: tuple[LinkParameters, ...]
    """How bad the link from each neighbour is, until a command says otherwise."""
    neighbours: tuple[int, ...]
    """Indices of the mechanical neighbours, the lower one first."""
    neighbour_joints: tuple[str, ...]
    top: bool
    tick_s: float
    controls: Controls
    reference_rad: float
    holds_orientation: bool
    """What a disabled board holds: its link's orientation in space (the paper's figure 4), or the
    controlled variable (its equation for epsilon)."""
    lumped_delay_ticks: int
    gains: ServoGains
    link: Link
    has_imu: bool
    has_force_plate: bool
    election: ElectionConfig | None
    """None: every board stays enabled (the original DEC)."""
    controller: Source | None = None
    """A servo from outside; None: ours."""
    rule: Source | None = None
    """An election from outside; None: ours."""
    cadence: Cadence | None = None
    """None: lockstep."""
    clock: ClockSheet = STEADY
    sensor_sheet: SensorSheet = EXACT
    torque_rate_nm_s: float | None = None
    """How fast the motor's torque can change; None: at once."""


def standing(links: list[list[Any]], sender: int, receiver: int) -> LinkParameters:
    """Parameters that a resolved scenario gives a directed link for good."""
    for some_sender, some_receiver, values in links:
        if (some_sender, some_receiver) == (sender, receiver):
            return changed(PERFECT, values)
    return PERFECT


def board_config(values: dict[str, Any], joint: str) -> BoardConfig:
    """Read one board from the values of a resolved scenario. Raises KeyError for another joint."""
    boards: list[dict[str, Any]] = values["board"]
    index = {board["joint"]: i for i, board in enumerate(boards)}[joint]
    board, election = boards[index], values["election"]
    adjacent = neighbours(index, len(boards))
    return BoardConfig(
        joint=joint,
        index=index,
        boards=len(boards),
        seed=values["run"]["seed"],
        standing_links=tuple(standing(values["link"], sender, index) for sender in adjacent),
        neighbours=adjacent,
        neighbour_joints=tuple(boards[i]["joint"] for i in adjacent),
        top=index == len(boards) - 1,
        tick_s=values["run"]["tick_s"],
        controls=Controls(board["controls"]),
        reference_rad=board["reference_rad"],
        holds_orientation=election["disabled_holds"] == "link-orientation",
        lumped_delay_ticks=board["lumped_delay_ticks"],
        gains=ServoGains(**board["servo"]),
        link=Link(**board["link"]),
        has_imu=board["imu"],
        has_force_plate=board["force_plate"],
        election=(
            ElectionConfig(
                period_ticks=election["period_ticks"],
                rounds=election["rounds"],
                keeps_last=election["incomplete"] == "keep-last",
            )
            if election["enabled"]
            else None
        ),
        controller=_source(values, board["controller"]),
        rule=_source(values, election["rule"]),
        cadence=cadence_of(values),
        clock=clock_sheet(board["clock"]),
        sensor_sheet=SensorSheet(**board["sensors"]),
        torque_rate_nm_s=board["actuator"]["torque_rate_nm_s"],
    )


def _source(values: dict[str, Any], named: dict[str, str] | None) -> Source | None:
    """Join what class is meant, and with which bytes, with where its file is on this machine."""
    if named is None:
        return None
    module = named["class"].partition(":")[0]
    return Source(named["class"], values["rig"]["sources"][module], named["sha256"])
