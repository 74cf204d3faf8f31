"""What a board is told at boot: one entry of the resolved scenario, as typed values."""

from dataclasses import dataclass
from typing import NamedTuple

from protocol.robot.cadence import Cadence, cadence_of
from protocol.robot.events import LinkParameters
from protocol.robot.hardware import STEADY, ClockSheet, Link, ServoGains
from protocol.robot.scenario import Controls, OutsideClass, Scenario
from protocol.robot.sensors import EXACT, SensorSheet
from protocol.wire.wiring import neighbours


class ElectionConfig(NamedTuple):
    """When boards elect, and what they do when they have not heard from everybody."""

    period_rounds: int
    """From one opening of an epoch to the next; in lockstep there is a round in every tick."""
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


def board_config(scenario: Scenario, joint: str) -> BoardConfig:
    """What the board of a joint has to know. Raises ValueError for another joint."""
    index = scenario.joints.index(joint)
    own, run, rule = scenario.boards[index], scenario.run, scenario.election
    adjacent = neighbours(index, len(scenario.boards))
    return BoardConfig(
        joint=joint,
        index=index,
        boards=len(scenario.boards),
        seed=run.seed,
        standing_links=tuple(scenario.standing_link(sender, index) for sender in adjacent),
        neighbours=adjacent,
        neighbour_joints=tuple(scenario.joints[i] for i in adjacent),
        top=index == len(scenario.boards) - 1,
        tick_s=run.tick_s,
        controls=own.controls,
        reference_rad=own.reference_rad,
        holds_orientation=rule.disabled_holds == "link-orientation",
        lumped_delay_ticks=own.lumped_delay_ticks,
        gains=own.servo,
        link=own.link,
        has_imu=own.imu,
        has_force_plate=own.force_plate,
        election=(
            ElectionConfig(rule.period_ticks, rule.rounds, rule.incomplete == "keep-last")
            if rule.enabled
            else None
        ),
        controller=_source(scenario, own.controller),
        rule=_source(scenario, rule.rule),
        cadence=cadence_of(scenario),
        clock=own.clock,
        sensor_sheet=own.sensors,
        torque_rate_nm_s=own.actuator.torque_rate_nm_s,
    )


def _source(scenario: Scenario, named: OutsideClass | None) -> Source | None:
    """Join what class is meant, and with which bytes, with where its file is on this machine."""
    if named is None:
        return None
    return Source(named.reference, scenario.rig.sources[named.module], named.sha256)
