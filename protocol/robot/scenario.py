"""The resolved scenario: what every process of a run starts from, and its digest.

A scenario is written as TOML, and checked and completed by `deploy`, which has the libraries for
it. What comes out, JSON with every value filled in, in SI units and whole ticks, is a `Scenario`.
Plant, boards and whoever reads a recording decode it once and take from it by name what concerns
them (S23).

Rule 1: nothing but this module and `protocol.robot.hardware` knows the keys of the JSON.
Rule 2: values by themselves are bounded by their types, values beside each other by `_conflicts`.
        What breaks a bound is refused, with its path.
Rule 3: the digest is of what a scenario means, as `canonical` writes it. It is part of enrolment,
        so processes started from different files refuse each other.
"""

import hashlib
import re
from collections.abc import Iterator
from enum import StrEnum
from functools import cached_property
from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct, field

from protocol.robot.canonical_json import canonical_json
from protocol.robot.events import (
    BOARDS_MAX,
    PERFECT,
    Command,
    EventError,
    LinkParameters,
    LinkRepair,
    changed,
    check_changes,
    check_event,
)
from protocol.robot.hardware import (
    Angle,
    ClockSheet,
    FootSheet,
    Link,
    MotorSheet,
    PassiveElement,
    Positive,
    ServoGains,
    Ticks,
    UnattendedJoint,
)
from protocol.robot.sensors import SensorName, SensorSheet, sensors_of

TicksSome = Annotated[int, Meta(ge=1, lt=2**31)]


class ScenarioError(Exception):
    """The scenario cannot be used; the message is what the user should read."""


class Controls(StrEnum):
    """The controlled variable alpha of a module (paper, section III-B)."""

    BODY_SWAY = "body-sway"
    """Sway of the centre of mass of all above the joint (the ankle's BS)."""
    JOINT_ANGLE = "joint-angle"
    """Angle of the joint itself (KNEE)."""
    LINK_ORIENTATION = "link-orientation"
    """Orientation in space of the link above the joint (the hip's TS)."""


class OutsideClass(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A controller or an election rule from outside: which class, and with which bytes."""

    reference: str = field(name="class")
    """Such as `my_module:MyServo`."""
    sha256: Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
    """Of the bytes of its file, in hex."""

    @property
    def module(self) -> str:
        """Name of the module that the class is in."""
        return self.reference.partition(":")[0]


class RunSettings(
    Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """How long, in which steps, and what counts as a fall."""

    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)]
    """Of all chance: link faults, noise, clocks."""
    ticks: TicksSome
    tick_s: Annotated[float, Meta(gt=0.0, le=1.0)]
    substeps: TicksSome
    """Steps of the integration in a tick."""
    fallen_below: Annotated[float, Meta(lt=1.0)]
    """The body has fallen when its centre of mass is below this fraction of its upright height.

    Below -1 for a body that hangs, and never falls."""
    pace: Positive | None = None
    """Seconds of the body in a second of the wall, in lockstep; None: as fast as it goes."""


class RigSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the robot lives, which is no part of what it is."""

    name: str
    host: str
    base_port: Annotated[int, Meta(ge=1024, le=65_535)]
    """The plant's; board i has the port 1 + i above it."""
    sources: dict[str, str] = {}
    """File of each module from outside, on this machine."""


class ElectionSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who may move: elected in every epoch, or everybody always (the original DEC)."""

    enabled: bool
    period_ticks: TicksSome
    """T_e."""
    rounds: TicksSome
    """Of agreement, from the start of an epoch to its latch."""
    disabled_holds: Literal["controlled-variable", "link-orientation"]
    """What a disabled board holds: the controlled variable (the paper's equation for epsilon), or
    its link's orientation in space (the paper's figure 4)."""
    incomplete: Literal["each-side", "keep-last"]
    """What a board does at the latch when it has not heard from everybody."""
    rule: OutsideClass | None
    """An election from outside; None: ours."""


class RealtimeSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How boards behave when nobody is waited for."""

    ticks_per_round: TicksSome
    """Of the plant, in one round of an election."""
    settle_ticks: Ticks
    """How much longer than a delay line the body is held before it is released."""
    ahead_ticks_max: Ticks
    """What was said more than this ahead of time is of another run: clocks differ by less."""
    age_ticks_max: Ticks
    """What is older is not acted on: a torque by the plant, an observation by a board."""
    missed: Literal["skip", "catch-up"]
    """What a board does about periods that it has missed."""


class LinkFaults(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """How bad a directed network link is from the start: `[sender, receiver, changes]`."""

    sender: Annotated[int, Meta(ge=0)]
    receiver: Annotated[int, Meta(ge=0)]
    changes: dict[str, float]
    """What of `protocol.robot.events.LinkParameters` is not perfect."""

    def __post_init__(self) -> None:
        """Refuse what no link can have. Raises ValueError."""
        check_changes(self.changes)


class ScenarioEvent(Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """What is done to the robot, and in which tick: `[tick, command]`."""

    tick: Ticks
    command: Command


class BoardSettings(
    Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True
):
    """One joint board, the joint that it drives, and the link above it."""

    joint: Annotated[str, Meta(min_length=1, max_length=64)]
    controls: Controls
    reference_rad: Angle
    """Of the controlled variable, until a command gives another."""
    initial_rad: Angle
    """Orientation in space of the link, at first."""
    lumped_delay_ticks: Ticks
    """From a sample to the torque that follows from it."""
    imu: bool
    """Whether the link carries one."""
    force_plate: bool
    """Whether the board reads one under the foot."""
    controller: OutsideClass | None
    """A servo from outside; None: ours."""
    servo: ServoGains
    unattended: UnattendedJoint
    link: Link
    clock: ClockSheet
    sensors: SensorSheet
    actuator: MotorSheet
    passive: PassiveElement
    foot: FootSheet | None
    """Of the lowest board; None: the ground takes any torque."""
    ticks_per_period: TicksSome | None = None
    """Of the plant, in one period of the board's own loop; None: in lockstep it has none."""

    @property
    def sensor_names(self) -> tuple[SensorName, ...]:
        """Which sensors it has."""
        return sensors_of(self.sensors, imu=self.imu, force_plate=self.force_plate)


class Scenario(
    Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    omit_defaults=True,
    dict=True,
    rename={"boards": "board", "events": "event", "link_faults": "link"},
):
    """A whole scenario, with every value filled in."""

    name: str
    description: str
    run: RunSettings
    rig: RigSettings
    election: ElectionSettings
    link_faults: tuple[LinkFaults, ...]
    """Of the network's links that are not perfect from the start."""
    events: tuple[ScenarioEvent, ...]
    """In the order of their ticks."""
    boards: Annotated[tuple[BoardSettings, ...], Meta(min_length=1, max_length=BOARDS_MAX)]
    """From the ground up."""
    link_names: tuple[str, ...]
    """Names of the body's links, from the ground up."""
    realtime: RealtimeSettings | None = None
    """None: lockstep."""

    def __post_init__(self) -> None:
        """Refuse what does not go together. Raises ValueError."""
        for conflict in _conflicts(self):
            raise ValueError(conflict)

    @cached_property
    def joints(self) -> list[str]:
        """Names of the joints, from the ground up."""
        return [board.joint for board in self.boards]

    @cached_property
    def standing_links(self) -> dict[tuple[int, int], LinkParameters]:
        """Parameters, other than perfect ones, of directed links (sender, receiver)."""
        return {
            (link.sender, link.receiver): changed(PERFECT, link.changes)
            for link in self.link_faults
        }

    def standing_link(self, sender: int, receiver: int) -> LinkParameters:
        """Parameters that a directed link has until a command says otherwise."""
        return self.standing_links.get((sender, receiver), PERFECT)

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of what the scenario means. `rig` says where the robot lives, not what it is."""
        return hashlib.sha256(meaning(self)).digest()


def canonical(scenario: Scenario) -> bytes:
    """The one way to write a resolved scenario down."""
    return canonical_json(msgspec.to_builtins(scenario))


def meaning(scenario: Scenario) -> bytes:
    """What a scenario says of the robot and the run, without where it is; of this is the digest."""
    tables = msgspec.to_builtins(scenario)
    del tables["rig"]
    return canonical_json(tables)


_decoder = msgspec.json.Decoder(Scenario)
_PLACE = re.compile(r"^(?P<reason>.*?)(?: - at `\$(?P<path>.*)`)?$", re.DOTALL)


def decode(payload: bytes) -> Scenario:
    """Read what `canonical` writes. Raises `ScenarioError`: the path of what is wrong, and why."""
    try:
        return _decoder.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(_complaint(str(error))) from error


def _complaint(text: str) -> str:
    """`path: reason`, as everywhere, of what msgspec complains about."""
    found = _PLACE.match(text)
    assert found is not None, "everything matches"
    path = re.sub(r"\[(\d+|\.\.\.)\]", r".\1", found["path"] or "").strip(".")
    reason = found["reason"].replace("`", "")
    reason = reason[:1].lower() + reason[1:]
    return f"{path}: {reason}" if path else reason


def _conflicts(scenario: Scenario) -> Iterator[str]:
    """What does not go together, each as `path: reason`."""
    boards, joints = scenario.boards, [board.joint for board in scenario.boards]
    if len(scenario.link_names) != len(boards):
        yield f"link_names: {len(scenario.link_names)} names for {len(boards)} boards"
    for i, board in enumerate(boards):
        if board.joint in joints[:i]:
            yield f"board.{i}.joint: {board.joint!r} is already another's"
        if (board.ticks_per_period is None) != (scenario.realtime is None):
            yield f"board.{i}.ticks_per_period: goes with realtime, and nothing else does"
    for i, link in enumerate(scenario.link_faults):
        pairs = ((link.sender, link.receiver),)
        yield from _command_conflicts(f"link.{i}", LinkRepair(pairs), joints)
    for i, event in enumerate(scenario.events):
        yield from _command_conflicts(f"event.{i}", event.command, joints)
    outside = [scenario.election.rule, *(board.controller for board in boards)]
    for named in outside:
        if named is not None and named.module not in scenario.rig.sources:
            yield f"rig.sources: there is no file of {named.module}"


def _command_conflicts(path: str, command: Command, joints: list[str]) -> Iterator[str]:
    try:
        check_event(command, joints)
    except EventError as error:
        yield f"{path}: {error}"


def run_id(digest: bytes) -> int:
    """Name of a run: 32 bits with the highest set, so that it always takes five bytes."""
    return int.from_bytes(digest[:4], "little") | 0x8000_0000


def next_run_id(former: int) -> int:
    """Name of the run that follows when a plant is started again before its boards have gone."""
    return (former + 1) & 0xFFFF_FFFF | 0x8000_0000
