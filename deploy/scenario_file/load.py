"""Scenarios: a TOML file in, every value checked and filled in, out.

What a user writes has units in its names; what plant and boards read is in SI and whole ticks.
Every complaint names the file and the path of the key, and all of them come at once. What a file
may say is in `deploy.scenario_file.tables`.
"""

import difflib
import math
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from deploy.scenario_file import controllers
from deploy.scenario_file.board_tables import (
    clock_sheet,
    foot_sheet,
    motor_sheet,
    passive_element,
    sensor_sheet,
)
from deploy.scenario_file.conflicts import body_of, misfits
from deploy.scenario_file.event_tables import LINK_PATTERN, commands, merged_links
from deploy.scenario_file.realtime_tables import resolve_realtime
from deploy.scenario_file.tables import (
    NAME_PATTERN,
    BoardTable,
    LinkTable,
    RunTable,
    ScenarioTable,
    ServoTable,
)
from deploy.scenario_file.ticks import whole_ticks
from module_agent.firmware.config import Source
from protocol.robot.hardware import Link, ServoGains, UnattendedJoint
from protocol.robot.scenario import (
    BoardSettings,
    Controls,
    ElectionSettings,
    OutsideClass,
    RealtimeSettings,
    RigSettings,
    RunSettings,
    Scenario,
    ScenarioError,
    ScenarioEvent,
)

SCENARIOS = Path(__file__).parents[1] / "scenarios"
EXTENDS_MAX = 8


def available() -> list[str]:
    """Names of the scenarios that come with decmesh."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def load(source: str, overrides: list[str] | None = None) -> Scenario:
    """Read a scenario by name or path, apply `key=value` overrides, check and resolve it.

    Raises `ScenarioError` with every complaint, one a line.
    """
    path = _find(source)
    folders: list[Path] = []
    tree = _read(path, folders)
    complaints = [line for override in overrides or [] for line in _apply(tree, override)]
    named = controllers.find(tree, folders)
    scenario = None
    try:
        scenario = ScenarioTable.model_validate(tree)
    except ValidationError as error:
        complaints += (f"{path}: {line}" for line in _complaints(error))
    complaints += (f"{path}: {line}" for line in (*misfits(tree), *named.complaints))
    if complaints:
        raise ScenarioError("\n".join(complaints))
    assert scenario is not None
    return _resolve(path.stem, scenario, named.sources)


def _read(path: Path, folders: list[Path]) -> dict[str, Any]:
    """Read a file, and below it what it extends; `folders` gets those that they lie in."""
    folders.append(path.parent)
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path}: not TOML: {error}") from error
    below, election = tree.get("extends"), tree.get("election")
    if isinstance(election, str):
        tree["election"] = {"rule": election}
    if not isinstance(below, str):
        return tree
    if len(folders) > EXTENDS_MAX:
        raise ScenarioError(f"{path}: extends: goes round in circles")
    return _merged(_read(_find(below), folders), tree)


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Put one tree over another: tables are merged, anything else is replaced."""
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        both = isinstance(old, dict) and isinstance(value, dict)
        merged[key] = _merged(old, value) if both else value  # type: ignore[arg-type]
    return merged


def _find(source: str) -> Path:
    if source.endswith(".toml") or "/" in source:
        path = Path(source)
        if not path.is_file():
            raise ScenarioError(f"{source}: no such file")
        return path
    path = SCENARIOS / f"{source}.toml"
    if not path.is_file():
        raise ScenarioError(f"{source}: no such scenario; {_hint(source, available())}")
    return path


def _apply(tree: dict[str, Any], override: str) -> Iterator[str]:
    """Set one value by its path, such as `board.0.servo.kp_nm_rad=400`; complain if it cannot."""
    path, separator, text = (part.strip() for part in override.partition("="))
    if not separator:
        yield f"--set {override}: expected key=value, such as run.duration_s=2"
        return
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    if path == "election" and isinstance(value, str):
        path = "election.rule"
    *parents, last = path.split(".")
    place: Any = tree
    try:
        for key in parents:
            place = place[int(key)] if isinstance(place, list) else place.setdefault(key, {})
        place[int(last) if isinstance(place, list) else last] = value
    except (IndexError, ValueError, TypeError, AttributeError):
        yield f"--set {override}: there is no {path!r} to set"


WRITTEN = {
    LINK_PATTERN: "is no link; write it like ankle-knee, or all",
    NAME_PATTERN: "is no name; it takes lower case, digits and _, a letter first, 16 at most",
}
"""What is wrong with a text that does not match a pattern."""


def _complaints(error: ValidationError) -> Iterator[str]:
    for issue in error.errors():
        path = ".".join(map(str, issue["loc"]))
        message = issue["msg"].removeprefix("Value error, ")
        if issue["type"] == "extra_forbidden":
            *parents, key = issue["loc"]
            message = f"unknown key; {_hint(str(key), _keys_at(parents))}"
        elif issue["type"] == "string_pattern_mismatch":
            message = f"{issue['input']!r} {WRITTEN.get(issue['ctx']['pattern'], 'cannot be')}"
        yield f"{path}: {message[0].lower()}{message[1:]}"


def _keys_at(path: Sequence[str | int]) -> list[str]:
    """Keys of the table that a path leads to, such as `board.0.servo` or `event.0.cut`."""
    tables: list[type[BaseModel]] = [ScenarioTable]
    for key in path:
        fields = [table.model_fields[str(key)] for table in tables if key in table.model_fields]
        if fields:
            tables = [inner for field in fields for inner in _tables_in(field.annotation)]
        elif isinstance(key, str):  # It tells which of several tables this one is.
            tables = [table for table in tables if _is_called(table, key)]
    return list(dict.fromkeys(key for table in tables for key in table.model_fields))


def _tables_in(kind: Any) -> list[type[BaseModel]]:
    """Tables that a type is made of: itself, or those of a list or a choice."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [table for inner in get_args(kind) for table in _tables_in(inner)]


def _is_called(table: type[BaseModel], name: str) -> bool:
    return any(name in get_args(field.annotation) for field in table.model_fields.values())


def _hint(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else f"there are: {', '.join(known)}"


def _resolve(name: str, table: ScenarioTable, sources: dict[str, Source]) -> Scenario:
    """Fill everything in, in SI units and ticks."""
    body = body_of(table.run, table.board)
    link_faults = merged_links(table.link, body)
    events = [entry for event in table.event for entry in commands(event, link_faults, body)]
    realtime, periods = _realtime(table)
    return Scenario(
        name=name,
        description=table.description,
        run=_run(table.run),
        rig=RigSettings(
            name=table.rig.name,
            host=table.rig.host,
            base_port=table.rig.base_port,
            sources=_files(sources),
        ),
        election=_election(table, sources),
        link_faults=tuple(link_faults),
        events=tuple(ScenarioEvent(*entry) for entry in sorted(events, key=lambda one: one[0])),
        boards=tuple(
            _board(board, table, period, sources)
            for board, period in zip(table.board, periods, strict=True)
        ),
        link_names=tuple(board.link.name for board in table.board),
        realtime=realtime,
    )


def _run(run: RunTable) -> RunSettings:
    return RunSettings(
        seed=run.seed,
        ticks=_ticks(run.duration_s * 1e3, run),
        tick_s=run.tick_ms / 1e3,
        substeps=run.substeps,
        fallen_below=run.fallen_below,
        pace=run.pace,
    )


def _election(table: ScenarioTable, sources: dict[str, Source]) -> ElectionSettings:
    election = table.election
    return ElectionSettings(
        enabled=election.enabled,
        period_ticks=_ticks(election.period_s * 1e3, table.run),
        rounds=election.rounds,
        disabled_holds=election.disabled_holds,
        incomplete=election.incomplete,
        rule=_outside(election.rule, sources),
    )


def _realtime(table: ScenarioTable) -> tuple[RealtimeSettings | None, Sequence[int | None]]:
    """What holds for all boards, and the period of each in ticks; None in lockstep."""
    if table.run.mode == "lockstep":
        return None, [None] * len(table.board)
    rates_hz = [board.rate_hz for board in table.board]
    return resolve_realtime(table.realtime, rates_hz, table.run.tick_ms)


def _ticks(time_ms: float, run: RunTable) -> int:
    ticks = whole_ticks(time_ms, run.tick_ms)
    assert ticks is not None, "times that are no whole number of ticks have been refused"
    return ticks


def _files(sources: dict[str, Source]) -> dict[str, str]:
    """Where the file of each module from outside is on this machine."""
    return {reference.partition(":")[0]: source.path for reference, source in sources.items()}


def _outside(reference: str | None, sources: dict[str, Source]) -> OutsideClass | None:
    """A class from outside, and what was in its file."""
    if reference is None:
        return None
    return OutsideClass(reference=reference, sha256=sources[reference].sha256)


def _board(
    board: BoardTable,
    table: ScenarioTable,
    ticks_per_period: int | None,
    sources: dict[str, Source],
) -> BoardSettings:
    unattended = board.unattended or table.unattended
    controller = controllers.reference_for(board.joint, board.controller, table.controller)
    return BoardSettings(
        joint=board.joint,
        controls=Controls(board.controls),
        reference_rad=math.radians(board.reference_deg),
        initial_rad=math.radians(board.initial_deg),
        lumped_delay_ticks=_ticks(board.lumped_delay_ms, table.run),
        imu=board.imu,
        force_plate=board.force_plate,
        controller=_outside(controller, sources),
        servo=_gains(board.servo),
        unattended=UnattendedJoint(
            unattended.how, unattended.stiffness_nm_rad, unattended.damping_nm_s_rad
        ),
        link=_link(board.link),
        clock=clock_sheet(board.clock, table.run.tick_ms),
        sensors=sensor_sheet(board.sensors),
        actuator=motor_sheet(board.actuator),
        passive=passive_element(board.passive),
        foot=foot_sheet(board.foot),
        ticks_per_period=ticks_per_period,
    )


def _gains(servo: ServoTable) -> ServoGains:
    return ServoGains(
        kp_nm_rad=servo.kp_nm_rad,
        kd_nm_s_rad=servo.kd_nm_s_rad,
        ki_nm_rad_s=servo.ki_per_s * servo.kp_nm_rad,
        g_servo=servo.g_servo,
        gravity_weight=servo.gravity_weight,
        torque_limit_nm=servo.torque_limit_nm,
    )


def _link(link: LinkTable) -> Link:
    """Where no inertia is given, that of a slender rod."""
    slender = link.mass_kg * link.length_m**2 / 12.0
    return Link(
        mass_kg=link.mass_kg,
        length_m=link.length_m,
        com_m=link.com_m,
        inertia_kg_m2=slender if link.inertia_kg_m2 is None else link.inertia_kg_m2,
    )
