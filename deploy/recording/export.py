"""A recording as tables for people's own analysis: CSV, numpy's npz, or Parquet.

Rule 1: three tables. `ticks` has a row for each tick since the release, `epochs` one for each
        election, `events` one for everything that happened, warm-up included.
Rule 2: a column's name ends in its unit; what has none is a count, a number or a word. States are
        those at the start of the tick, and T rows have T of them: the last state is left out.
Rule 3: a number is written so that reading it gives the same bits.
"""

import csv
import json
from collections.abc import Callable, Iterator
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deploy.failure import FailedError
from deploy.recording.arrays import Recording
from deploy.recording.frame_fate import FrameFate
from protocol.process.exit_codes import ExitCode
from protocol.robot.events import tag_of, values_of
from protocol.robot.states import State

Column = NDArray[Any]
Integers = NDArray[np.int64]
Table = dict[str, Column]
ABSENT = "absent"
"""The state of a board that is not there."""


def tables(recording: Recording) -> dict[str, Table]:
    """Ticks, epochs and events, each a table of columns of one length."""
    return {
        "ticks": dict(_ticks(recording)),
        "epochs": dict(_epochs(recording)),
        "events": _events(recording),
    }


def write_tables(found: dict[str, Table], folder: Path, ending: str) -> list[Path]:
    """Write each table to a file of its own: "csv", "npz" or "parquet". Raises OSError.

    Raises `FailedError` when there is no library for that.
    """
    write = {"csv": lambda: _write_csv, "npz": lambda: _write_npz, "parquet": _parquet}[ending]()
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, table in found.items():
        if table:
            files.append(folder / f"{name}.{ending}")
            write(table, files[-1])
    return files


def _ticks(recording: Recording) -> Iterator[tuple[str, Column]]:
    run = recording.trajectory
    yield "tick", np.arange(run.ticks)
    yield "time_s", run.times_s[:-1]
    orientations_rad = run.orientations_rad
    for board, joint in enumerate(run.joints):
        yield f"{joint}_angle_rad", run.angles_rad[:-1, board]
        yield f"{joint}_rate_rad_s", run.rates_rad_s[:-1, board]
        yield f"{joint}_torque_nm", run.torques_nm[:, board]
        yield f"{joint}_controlled_rad", run.controlled_rad[:, board]
        yield f"{joint}_state", _words(run.state[:, board], State)
        yield f"{joint}_enabled", run.enabled[:, board]
        yield f"{joint}_epoch", run.epoch[:, board]
        yield f"{joint}_round", run.round[:, board]
        yield f"{joint}_urgency_rad", run.urgency[:, board]
        yield f"{joint}_candidate", run.candidate[:, board]
        yield f"{joint}_answered_ns", recording.answered_ns[:, board]
        yield f"{joint}_taken_up_ns", recording.taken_up_ns[:, board]
        yield f"{joint}_decided_ns", recording.decided_ns[:, board]
        yield f"{joint}_said_ns", recording.said_ns[:, board]
    for link, name in enumerate(run.scenario.link_names):
        yield f"{name}_orientation_rad", orientations_rad[:-1, link]
    yield "plant_opened_ns", recording.opened_ns
    yield "plant_closed_ns", recording.closed_ns
    for (sender, receiver), frames in recording.links.items():
        link_name = f"{run.joints[sender]}_to_{run.joints[receiver]}"
        yield f"{link_name}_fate", _words(frames.fate, FrameFate)
        yield f"{link_name}_heard_tick", frames.heard_tick
        yield f"{link_name}_size_bytes", frames.frame_bytes
        yield f"{link_name}_sent_ns", frames.sent_ns
        yield f"{link_name}_arrived_ns", frames.arrived_ns


def _epochs(recording: Recording) -> Iterator[tuple[str, Column]]:
    found = recording.epochs
    if found is None:
        return
    yield "epoch", found.number
    yield "first_tick", found.first_tick
    yield "latch_tick", found.latch_tick
    yield "agreed_after_rounds", found.agreed_after
    yield "enabled_boards", found.enabled_boards
    for board, joint in enumerate(recording.trajectory.joints):
        yield f"{joint}_member", found.members[:, board].astype(np.int64)
        yield f"{joint}_w_rad", found.w_rad[:, board]
        yield f"{joint}_known_after_rounds", found.known_after[:, board]
        yield f"{joint}_enabled", found.enabled[:, board].astype(np.int64)


def _events(recording: Recording) -> Table:
    run = recording.trajectory
    ticks = np.array([tick for tick, _ in run.events], np.int64)
    return {
        "tick": ticks,
        "time_s": ticks * run.tick_s,
        "what": np.array([tag_of(event) for _, event in run.events], np.str_),
        "event_json": np.array([json.dumps(values_of(event)) for _, event in run.events], np.str_),
    }


def _write_csv(table: Table, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        # Numbers of Python, not of numpy: their text gives back every bit.
        writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))


def _write_npz(table: Table, path: Path) -> None:
    columns: Any = table  # Any name will do for an array but `allow_pickle`.
    np.savez_compressed(path, **columns)


def _parquet() -> Callable[[Table, Path], None]:
    """Look for the library before anything is written."""
    try:
        import pyarrow as pa  # noqa: PLC0415 - an extra: 40 MB that few need.
        from pyarrow import parquet  # noqa: PLC0415 - as above
    except ImportError as error:
        line = "Parquet needs pyarrow: pip install 'decmesh[parquet]'"
        raise FailedError(ExitCode.BAD_INPUT, line) from error
    return lambda table, path: parquet.write_table(pa.table(table), path)


def _words(numbers: Integers, kind: type[IntEnum]) -> Column:
    """In place of numbers, what they stand for."""
    words = {0: ABSENT, **{member.value: member.name.lower() for member in kind}}
    return np.array([words.get(number, str(number)) for number in numbers.tolist()], np.str_)
