"""Misfits: what does not go together in a scenario file, though each value is fine by itself.

Rule: each is told as `path: reason`, and what could not be read at all is told elsewhere.
"""

from collections.abc import Iterator
from contextlib import suppress
from math import cos, radians
from typing import Any, TypeGuard, TypeVar

from pydantic import TypeAdapter, ValidationError

from deploy.scenario_file.board_tables import hardware_misfits, realtime_clock_misfits, sensor_names
from deploy.scenario_file.event_tables import (
    AnyEvent,
    BodyNames,
    StandingLink,
    commands,
    standing_links,
)
from deploy.scenario_file.realtime_tables import Rounds, realtime_misfits
from deploy.scenario_file.tables import (
    PORT_MAX,
    BoardTable,
    ElectionTable,
    RigTable,
    RunTable,
    StrictTable,
)
from deploy.scenario_file.ticks import MeaningError, whole_ticks

RESERVED = frozenset({"plant"})
"""Names that stand for somebody else where a key has the name of a joint."""
AnyTable = TypeVar("AnyTable", bound=StrictTable)


def misfits(tree: dict[str, Any]) -> Iterator[str]:
    """What is wrong between values that are fine by themselves, each as `path: reason`."""
    run = _if_valid(RunTable, tree.get("run", {}))
    election = _if_valid(ElectionTable, tree.get("election", {}))
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
                yield from hardware_misfits(i, board, body_of(run, []))
    if election is not None and election.enabled and election.rounds < len(boards) - 1:
        yield (
            f"election.rounds: {election.rounds} is less than the {len(boards) - 1} hops from end"
            f" to end, so the boards could not agree"
        )
    if run is not None and run.mode == "realtime":
        there = [(i, board) for i, board in enumerate(boards) if board is not None]
        yield from _realtime_misfits(tree.get("realtime", {}), run, election, there)
    yield from _joint_misfits(entries if _is_list(entries) else [])
    if run is not None and all(board is not None for board in boards):
        yield from _event_misfits(tree, run, [board for board in boards if board is not None])
    yield from _posture_misfits([board for board in boards if board is not None], run or RunTable())
    if boards and boards[-1] is not None and not boards[-1].imu:
        yield f"board.{len(boards) - 1}.imu: the top board must carry an IMU"


def _realtime_misfits(
    table: object,
    run: RunTable,
    election: ElectionTable | None,
    boards: list[tuple[int, BoardTable]],
) -> Iterator[str]:
    rounds = None
    if election is not None and election.enabled:
        rounds = Rounds(election.period_s * 1e3, election.rounds)
    rates_hz = [board.rate_hz for _, board in boards]
    yield from realtime_misfits(table, rates_hz, tick_ms=run.tick_ms, pace=run.pace, rounds=rounds)
    for i, board in boards:
        yield from realtime_clock_misfits(f"board.{i}.clock", board.clock)


_EVENT: TypeAdapter[AnyEvent] = TypeAdapter(AnyEvent)


def _posture_misfits(boards: list[BoardTable], run: RunTable) -> Iterator[str]:
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


def _event_misfits(tree: dict[str, Any], run: RunTable, boards: list[BoardTable]) -> Iterator[str]:
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


def body_of(run: RunTable, boards: list[BoardTable]) -> BodyNames:
    """What names and times in events stand for."""
    return BodyNames(
        joints=[board.joint for board in boards],
        segments=[board.link.name for board in boards],
        sensors=[sensor_names(board) for board in boards],
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


def _run_misfits(run: RunTable, election: ElectionTable | None) -> Iterator[str]:
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


def _delay_misfits(i: int, board: BoardTable, run: RunTable, *, hops_up: int) -> Iterator[str]:
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
