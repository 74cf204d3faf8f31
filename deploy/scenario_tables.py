"""Scenario tables: what a scenario file may say, and what is wrong with it.

Rule 1: a value by itself is checked by the table that it is in; values against each other by
        `misfits`. Both always run, so that all mistakes are found at once.
Rule 2: what a user writes has its unit in its name (`initial_deg`, `lumped_delay_ms`).
"""

from collections.abc import Iterator
from contextlib import suppress
from math import cos, radians
from typing import Annotated, Any, Literal, Self, TypeGuard, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from deploy.event_tables import (
    AnyEvent,
    Body,
    MeaningError,
    StandingLink,
    commands,
    standing_links,
)
from deploy.realtime_tables import Rate, RealtimeTable, Rounds, realtime_misfits
from deploy.ticks import whole_ticks

Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,15}$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Duration = Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)]
"""In seconds: a day and a bit, so that ticks of 0.1 ms can be counted in 32 bits."""

PORT_MAX = 65_535
RESERVED = frozenset({"plant"})
"""Names that stand for somebody else where a key has the name of a joint."""


class Table(BaseModel):
    """A TOML table: unknown keys are mistakes, and text is not a number."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


AnyTable = TypeVar("AnyTable", bound=Table)


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


class BoardTable(Table):
    """One joint board and the link that it carries."""

    joint: Name
    controls: Literal["body-sway", "joint-angle", "link-orientation"]
    reference_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    initial_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    lumped_delay_ms: Annotated[float, Field(ge=0, le=10_000)] = 10.0
    imu: bool = False
    force_plate: bool = False
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
    board: Annotated[list[BoardTable], Field(min_length=1, max_length=2000)]
    link: list[StandingLink] = []
    event: list[AnyEvent] = []


def misfits(tree: dict[str, Any]) -> Iterator[str]:
    """What is wrong between values that are fine by themselves, each as `path: reason`."""
    run = _if_valid(Run, tree.get("run", {}))
    election = _if_valid(Election, tree.get("election", {}))
    entries = tree.get("board")
    boards = [_if_valid(BoardTable, entry) for entry in entries] if _is_list(entries) else []
    rig = _if_valid(RigTable, tree.get("rig", {}))
    if rig is not None and rig.base_port + len(boards) > PORT_MAX:
        yield (
            f"rig.base_port: {rig.base_port} and one more for each of {len(boards)} boards goes"
            f" beyond {PORT_MAX}, the last port"
        )
    if run is not None:
        yield from _run_misfits(run, election)
        for i, board in enumerate(boards):
            if board is not None:
                yield from _delay_misfits(i, board, run, hops_up=len(boards) - 1 - i)
    if election is not None and election.enabled and election.rounds < len(boards) - 1:
        yield (
            f"election.rounds: {election.rounds} is less than the {len(boards) - 1} hops from end"
            f" to end, so the boards could not agree"
        )
    if run is not None and run.mode == "realtime":
        yield from realtime_misfits(
            tree.get("realtime", {}),
            [board.rate_hz for board in boards if board is not None],
            tick_ms=run.tick_ms,
            pace=run.pace,
            rounds=Rounds(election.period_s * 1e3, election.rounds)
            if election is not None and election.enabled
            else None,
        )
    yield from _joint_misfits(entries if _is_list(entries) else [])
    if run is not None and all(board is not None for board in boards):
        yield from _event_misfits(tree, run, [board for board in boards if board is not None])
    yield from _posture_misfits([board for board in boards if board is not None], run or Run())
    if boards and boards[-1] is not None and not boards[-1].imu:
        yield f"board.{len(boards) - 1}.imu: the top board must carry an IMU"


_EVENT: TypeAdapter[AnyEvent] = TypeAdapter(AnyEvent)


def _posture_misfits(boards: list[BoardTable], run: Run) -> Iterator[str]:
    """A body that has fallen before it begins; the plant's own bound is the same (S21)."""
    upright_kg_m = height_kg_m = 0.0
    above_kg = sum(board.link.mass_kg for board in boards)
    for board in boards:
        above_kg -= board.link.mass_kg
        moment_kg_m = board.link.mass_kg * board.link.com_m + above_kg * board.link.length_m
        upright_kg_m += moment_kg_m
        height_kg_m += moment_kg_m * cos(radians(board.initial_deg))
    if height_kg_m < run.fallen_below * upright_kg_m:
        yield (
            "board.0.initial_deg: with these initial angles the centre of mass is below"
            f" {run.fallen_below:g} of its upright height: the body has fallen before it begins"
        )


def _event_misfits(tree: dict[str, Any], run: Run, boards: list[BoardTable]) -> Iterator[str]:
    """Names and times that mean nothing for this body."""
    body = body_of(run, boards)
    links, events = tree.get("link", []), tree.get("event", [])
    for i, entry in enumerate(links if _is_list(links) else []):
        with suppress(ValidationError):  # That has been complained about already.
            try:
                standing_links(StandingLink.model_validate(entry), body)
            except MeaningError as error:
                yield f"link.{i}.{error}"
    for i, entry in enumerate(events if _is_list(events) else []):
        with suppress(ValidationError):
            try:
                commands(_EVENT.validate_python(entry), [], body)
            except MeaningError as error:
                yield f"event.{i}.{error}"


def body_of(run: Run, boards: list[BoardTable]) -> Body:
    """What names and times in events stand for."""
    return Body(
        joints=[board.joint for board in boards],
        segments=[board.link.name for board in boards],
        tick_ms=run.tick_ms,
        ticks=whole_ticks(run.duration_s * 1e3, run.tick_ms) or 0,
    )


def _joint_misfits(entries: list[Any]) -> Iterator[str]:
    taken: dict[str, int] = {}
    for i, entry in enumerate(entries):
        joint = entry.get("joint") if isinstance(entry, dict) else None
        if not isinstance(joint, str):
            continue
        if joint in RESERVED:
            yield f"board.{i}.joint: {joint!r} is reserved; choose another name"
        elif taken.setdefault(joint, i) != i:
            yield f"board.{i}.joint: {joint!r} is already board.{taken[joint]}"


def _run_misfits(run: Run, election: Election | None) -> Iterator[str]:
    if whole_ticks(run.duration_s * 1e3, run.tick_ms) is None:
        yield _not_whole("run.duration_s", f"{run.duration_s:g} s", run.tick_ms)
    if election is None:
        return
    period_ticks = whole_ticks(election.period_s * 1e3, run.tick_ms)
    if period_ticks is None:
        yield _not_whole("election.period_s", f"{election.period_s:g} s", run.tick_ms)
    elif election.rounds >= period_ticks:
        yield (
            f"election.rounds: {election.rounds} rounds, one a tick, do not fit into a period of"
            f" {period_ticks} ticks; rounds must be below it"
        )


def _delay_misfits(i: int, board: BoardTable, run: Run, *, hops_up: int) -> Iterator[str]:
    path, delay_ms = f"board.{i}.lumped_delay_ms", board.lumped_delay_ms
    delay_ticks = whole_ticks(delay_ms, run.tick_ms)
    if delay_ticks is None:
        yield _not_whole(path, f"{delay_ms:g} ms", run.tick_ms)
    elif delay_ticks < hops_up:
        yield (
            f"{path}: {delay_ticks} ticks are fewer than the {hops_up} hops that what lies above"
            f" needs to get here"
        )


def _if_valid(table: type[AnyTable], values: object) -> AnyTable | None:
    """The table, for a look at it beside others; keys that it does not know are left out."""
    known = table.model_fields
    if isinstance(values, dict):
        values = {key: value for key, value in values.items() if key in known}
    try:
        return table.model_validate(values)
    except ValidationError:
        return None


def _is_list(values: object) -> TypeGuard[list[Any]]:
    return isinstance(values, list)


def _not_whole(path: str, value: str, tick_ms: float) -> str:
    return f"{path}: {value} is not a whole number of ticks of {tick_ms:g} ms"
