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

NAME_PATTERN = r"^[a-z][a-z0-9_]{0,15}$"
Name = Annotated[str, StringConstraints(pattern=NAME_PATTERN)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Duration = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
"""In seconds: a day and a bit, so that ticks of 0.1 ms can be counted in 32 bits."""


PORT_MAX = 65_535


class Table(BaseModel):
    """A TOML table: unknown keys are mistakes, and text is not a number."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Run(Table):
    """How long, in which steps, and what counts as a fall."""

    duration_s: Duration = 10.0
    tick_ms: Annotated[float, Field(ge=0.1, le=100, allow_inf_nan=False)] = 1.0
    substeps: Annotated[int, Field(ge=1, le=1000)] = 1
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    fallen_below: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """The body has fallen when its centre of mass is below this fraction of its upright height."""
    mode: Literal["lockstep", "realtime"] = "lockstep"
    pace: Positive | None = None
    """Seconds of the body in a second of the wall, in lockstep; none: as fast as it goes."""


class RigTable(Table):
    """Where the robot lives on the network."""

    name: Name = "robot"
    host: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.:\[\]-]+$")] = "127.0.0.1"
    base_port: Annotated[int, Field(ge=1024, le=PORT_MAX)] = 17_700


class Election(Table):
    """Who may move: elected every T_e, or everybody always (the original DEC)."""

    enabled: bool = True
    period_s: Duration = 0.1
    rounds: Annotated[int, Field(ge=1)] = 2
    disabled_holds: Literal["controlled-variable", "link-orientation"] = "controlled-variable"
    incomplete: Literal["each-side", "keep-last"] = "each-side"
    rule: Reference | None = None


class ServoTable(Table):
    """Gains of one module (the paper's table I)."""

    kp_nm_rad: NotNegative
    kd_nm_s_rad: NotNegative
    ki_per_s: NotNegative = 0.0
    g_servo: NotNegative = 1.0
    gravity_weight: NotNegative = 0.0
    torque_limit_nm: Positive = 1000.0


class LinkTable(Table):
    """The link above a joint."""

    name: Name
    mass_kg: Positive
    length_m: Positive
    com_m: Positive
    inertia_kg_m2: Positive | None = None

    @model_validator(mode="after")
    def _com_on_the_link(self) -> Self:
        if self.com_m > self.length_m:
            raise ValueError(f"com_m {self.com_m} lies beyond length_m {self.length_m}")
        return self


class UnattendedTable(Table):
    """What a joint without a board does: turn freely, be locked, or have a spring and a damper."""

    how: Literal["limp", "braked", "passive"] = "limp"
    stiffness_nm_rad: NotNegative = 0.0
    damping_nm_s_rad: NotNegative = 0.0


class BoardTable(Table, BoardHardware):
    """One joint board and the link that it carries."""

    joint: Name
    controls: Literal["body-sway", "joint-angle", "link-orientation"]
    reference_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    initial_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    lumped_delay_ms: Annotated[float, Field(ge=0, le=10_000)] = 10.0
    controller: Reference | None = None
    rate_hz: Rate | None = None
    """In realtime; none: that of `RealtimeTable`."""
    servo: ServoTable
    link: LinkTable
    unattended: UnattendedTable | None = None


class Scenario(Table):
    """A whole scenario file."""

    extends: str = ""
    """Name of a scenario that this one starts from; tables are merged, lists replaced."""
    description: str = ""
    run: Run = Run()
    rig: RigTable = RigTable()
    election: Election = Election()
    realtime: RealtimeTable = RealtimeTable()
    unattended: UnattendedTable = UnattendedTable()
    """For boards that have no such table of their own."""
    controller: ControllerOfBoards = None
    """For boards that name none of their own: one for all, or a table by joint."""
    board: Annotated[list[BoardTable], Field(min_length=1, max_length=2000)]
    link: list[StandingLink] = []
    event: list[AnyEvent] = []
