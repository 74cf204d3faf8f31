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
from deploy.scenario_file.board_tables import resolved_hardware
from deploy.scenario_file.conflicts import body_of, misfits
from deploy.scenario_file.event_tables import LINK_PATTERN, commands, merged_links
from deploy.scenario_file.realtime_tables import resolve_realtime
from deploy.scenario_file.tables import NAME_PATTERN, BoardTable, Scenario
from deploy.scenario_file.ticks import whole_ticks
from module_agent.firmware.config import Source
from protocol.robot.scenario import ResolvedScenario, ScenarioError, resolved

SCENARIOS = Path(__file__).parents[1] / "scenarios"
EXTENDS_MAX = 8


def available() -> list[str]:
    """Names of the scenarios that come with decmesh."""
    return sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def load(source: str, overrides: list[str] | None = None) -> ResolvedScenario:
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
        scenario = Scenario.model_validate(tree)
    except ValidationError as error:
        complaints += (f"{path}: {line}" for line in _complaints(error))
    complaints += (f"{path}: {line}" for line in (*misfits(tree), *named.complaints))
    if complaints:
        raise ScenarioError("\n".join(complaints))
    assert scenario is not None
    return resolved(_resolve(path.stem, scenario, named.sources))


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
    tables: list[type[BaseModel]] = [Scenario]
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


def _resolve(name: str, scenario: Scenario, sources: dict[str, Source]) -> dict[str, Any]:
    """Fill everything in, in SI units and ticks."""
    run, election = scenario.run, scenario.election
    body = body_of(run, scenario.board)
    standing = merged_links(scenario.link, body)
    events = [entry for event in scenario.event for entry in commands(event, standing, body)]
    tick_s = run.tick_ms / 1e3
    values: dict[str, Any] = {
        "name": name,
        "description": scenario.description,
        "run": {
            "seed": run.seed,
            "ticks": whole_ticks(run.duration_s * 1e3, run.tick_ms),
            "tick_s": tick_s,
            "substeps": run.substeps,
            "fallen_below": run.fallen_below,
        },
        "rig": {**scenario.rig.model_dump(), "sources": _files(sources)},
        "election": {
            "enabled": election.enabled,
            "period_ticks": whole_ticks(election.period_s * 1e3, run.tick_ms),
            "rounds": election.rounds,
            "disabled_holds": election.disabled_holds,
            "incomplete": election.incomplete,
            "rule": _class(election.rule, sources),
        },
        "link": standing,
        "event": sorted(map(list, events), key=lambda entry: entry[0]),
        "board": [_resolve_board(board, scenario, sources) for board in scenario.board],
        "link_names": [board.link.name for board in scenario.board],
    }
    if run.pace is not None:
        values["run"]["pace"] = run.pace
    if run.mode == "realtime":
        rates_hz = [board.rate_hz for board in scenario.board]
        values["realtime"], periods = resolve_realtime(scenario.realtime, rates_hz, run.tick_ms)
        for board, ticks in zip(values["board"], periods, strict=True):
            board["ticks_per_period"] = ticks
    return values


def _files(sources: dict[str, Source]) -> dict[str, str]:
    """Where the file of each module from outside is on this machine."""
    return {reference.partition(":")[0]: source.path for reference, source in sources.items()}


def _class(reference: str | None, sources: dict[str, Source]) -> dict[str, str] | None:
    """A class from outside, and what was in its file."""
    if reference is None:
        return None
    return {"class": reference, "sha256": sources[reference].sha256}


def _resolve_board(
    board: BoardTable, scenario: Scenario, sources: dict[str, Source]
) -> dict[str, Any]:
    servo, link = board.servo, board.link
    slender = link.mass_kg * link.length_m**2 / 12.0
    return {
        "joint": board.joint,
        "controls": board.controls,
        "reference_rad": math.radians(board.reference_deg),
        "initial_rad": math.radians(board.initial_deg),
        "lumped_delay_ticks": whole_ticks(board.lumped_delay_ms, scenario.run.tick_ms),
        "imu": board.imu,
        "force_plate": board.force_plate,
        "controller": _class(
            controllers.reference_for(board.joint, board.controller, scenario.controller), sources
        ),
        "servo": {
            "kp_nm_rad": servo.kp_nm_rad,
            "kd_nm_s_rad": servo.kd_nm_s_rad,
            "ki_nm_rad_s": servo.ki_per_s * servo.kp_nm_rad,
            "g_servo": servo.g_servo,
            "gravity_weight": servo.gravity_weight,
            "torque_limit_nm": servo.torque_limit_nm,
        },
        "unattended": (board.unattended or scenario.unattended).model_dump(),
        "link": {
            "mass_kg": link.mass_kg,
            "length_m": link.length_m,
            "com_m": link.com_m,
            "inertia_kg_m2": slender if link.inertia_kg_m2 is None else link.inertia_kg_m2,
        },
        **resolved_hardware(board, scenario.run.tick_ms),
    }
