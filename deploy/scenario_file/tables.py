"""Scenario tables: what a scenario file may say.

Rule 1: a value by itself is checked by the table that it is in; values against each other by
        `deploy.scenario_file.conflicts`. Both always run, so that all mistakes are found at once.
Rule 2: what a user writes has its unit in its name (`initial_deg`, `lumped_delay_ms`).
"""

from typing import Annotated, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    model_validator,
)

from deploy.scenario_file.board_tables import BoardHardware
from deploy.scenario_file.controllers import ControllerOfBoards, Reference
from deploy.scenario_file.event_tables import (
    AnyEvent,
    StandingLink,
)
from deploy.scenario_file.realtime_tables import Rate, RealtimeTable

HOST_PATTERN = r"^[A-Za-z0-9_.:\[\]-]+$"
NAME_PATTERN = r"^[a-z][a-z0-9_]{0,15}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Duration = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
"""In seconds: a day and a bit, so that ticks of 0.1 ms can be counted in 32 bits."""


PORT_MAX = 65_535


class StrictTable(BaseModel):
    """A TOML table: unknown keys are mistakes, and text is not a number."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class RunTable(StrictTable):
    """How long, in which steps, and what counts as a fall."""

    duration_s: Duration = 10.0
    """How long the body is free; a whole number of ticks."""
    tick_ms: Annotated[float, Field(ge=0.1, le=100, allow_inf_nan=False)] = 1.0
    """Length of a tick."""
    substeps: Annotated[int, Field(ge=1, le=1000)] = 1
    """Runge-Kutta steps per tick."""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    """Of everything random."""
    fallen_below: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """The body has fallen when its centre of mass is below this share of its upright height."""
    mode: Literal["lockstep", "realtime"] = "lockstep"
    """Boards and plant wait for each other, or go by the wall clock."""
    pace: Positive | None = None
    """Simulated seconds per second of wall time, at most; in lockstep. None: as fast as it goes."""


class RigTable(StrictTable):
    """Where the robot lives on the network."""

    name: Name = "robot"
    """Keeps robots on one network apart."""
    host: Annotated[str, StringConstraints(pattern=HOST_PATTERN)] = "127.0.0.1"
    """Address that all processes of this robot listen on."""
    base_port: Annotated[int, Field(ge=1024, le=PORT_MAX)] = 17_700
    """Of the plant; board n, counted from 0, listens on base_port + 1 + n."""


class ElectionTable(StrictTable):
    """Who may move: elected every T_e, or everybody always (the original DEC)."""

    enabled: bool = True
    """False: all boards move always."""
    period_s: Duration = 0.1
    """Length of an epoch, T_e; a whole number of ticks."""
    rounds: Annotated[int, Field(ge=1)] = 2
    """Rounds of max-consensus per epoch, R: at least the hops from end to end."""
    disabled_holds: Literal["controlled-variable", "link-orientation"] = "controlled-variable"
    """What a board keeps constant while it is disabled."""
    incomplete: Literal["each-side", "keep-last"] = "each-side"
    """What a board does that has not heard from all neighbours: decide alone, or keep y."""
    rule: Reference | None = None
    """An election of your own, such as my_module:MyElection. None: max-consensus."""


class ServoTable(StrictTable):
    """Gains of one module (the paper's table I)."""

    kp_nm_rad: NotNegative
    """Proportional gain."""
    kd_nm_s_rad: NotNegative
    """Derivative gain."""
    ki_per_s: NotNegative = 0.0
    """Integral gain, as a multiple of kp_nm_rad."""
    g_servo: NotNegative = 1.0
    """Factor on all three gains."""
    gravity_weight: NotNegative = 0.0
    """Gravity compensation: times kp_nm_rad times the angle of the carried centre of mass."""
    torque_limit_nm: Positive = 1000.0
    """Of the motor; the integral stands still at the limit."""


class LinkTable(StrictTable):
    """The link above a joint."""

    name: Name
    """Of the link; in results shank, thigh and trunk are SS, THS and TS, as in the paper."""
    mass_kg: Positive
    """Mass."""
    length_m: Positive
    """From joint to joint."""
    com_m: Positive
    """From the joint below to the centre of mass."""
    inertia_kg_m2: Positive | None = None
    """About the centre of mass. None: a slender rod, m l² / 12."""

    @model_validator(mode="after")
    def _com_on_the_link(self) -> Self:
        if self.com_m > self.length_m:
            raise ValueError(f"com_m {self.com_m} lies beyond length_m {self.length_m}")
        return self


class UnattendedTable(StrictTable):
    """What a joint without a board does: turn freely, be locked, or have a spring and a damper."""

    how: Literal["limp", "braked", "passive"] = "limp"
    """Turns freely, is locked, or has a spring and a damper."""
    stiffness_nm_rad: NotNegative = 0.0
    """Of a passive joint."""
    damping_nm_s_rad: NotNegative = 0.0
    """Of a passive joint."""


class BoardTable(StrictTable, BoardHardware):
    """One joint board and the link that it carries."""

    joint: Name
    """Its name; not `plant`."""
    controls: Literal["body-sway", "joint-angle", "link-orientation"]
    """What the board drives to its reference."""
    reference_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    """Where the controlled variable should go."""
    initial_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    """Orientation in space of the link above the joint at the start, forward positive."""
    lumped_delay_ms: Annotated[float, Field(ge=0, le=10_000)] = 10.0
    """Age of the samples that the servo uses; whole ticks, at least the hops to the top."""
    controller: Reference | None = None
    """A servo of your own, such as my_module:MyServo. None: that of the paper."""
    rate_hz: Rate | None = None
    """Of this board's loop in realtime. None: that of `[realtime]`."""
    servo: ServoTable
    link: LinkTable
    unattended: UnattendedTable | None = None
    """What this joint does without a board. None: `[unattended]` of the scenario."""


class ScenarioTable(StrictTable):
    """Keys above all tables."""

    extends: str = ""
    """A scenario, by name or path, to start from; tables are merged, lists replaced."""
    description: str = ""
    """One line for `decmesh scenarios`."""
    run: RunTable = RunTable()
    rig: RigTable = RigTable()
    election: ElectionTable = ElectionTable()
    realtime: RealtimeTable = RealtimeTable()
    unattended: UnattendedTable = UnattendedTable()
    """For boards that have no such table of their own."""
    controller: ControllerOfBoards = None
    """A servo of your own for all boards, or a table with one by joint."""
    board: Annotated[list[BoardTable], Field(min_length=1, max_length=2000)]
    link: list[StandingLink] = []
    event: list[AnyEvent] = []
