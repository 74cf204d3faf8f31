"""From a run's spool to its results. Imports numpy, so it is imported when the run is over.

Rule: the spool goes when `run.mcap` is whole, and not before. Whatever comes in between, a full
disk or Ctrl-C, what was recorded is there, and `decmesh recover` makes the file of it. The spool of
a run whose recording was cut off stays as well: it may hold more than could be read.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from rich.console import Group

from deploy.launch.processes import SPOOL
from deploy.launch.run import SUMMARY
from deploy.outcome import figures
from deploy.outcome.realtime_table import realtime_table
from deploy.outcome.summary import Mode, Summary, summary, write_summary
from deploy.outcome.table_ii import report
from deploy.recording.files import MCAP
from deploy.recording.logical_digest import logical_sha256
from deploy.recording.realtime_times import realtime_times
from deploy.recording.recovery import rescue
from deploy.recording.spools import read_spool_of
from deploy.recording.trajectory import Trajectory, recorded_trajectory
from plant_server.spool.spool import Spool, read_spool


class FinishedRun(NamedTuple):
    """A run that is over, as far as it was recorded."""

    spool: Spool
    trajectory: Trajectory
    summary: Summary


def read_run(folder: Path) -> Trajectory | None:
    """Read a run back from its folder; None if it never got as far as an end."""
    spool = read_spool_of(folder)
    if spool.outcome is None or spool.outcome.tick <= 0:
        return None
    return recorded_trajectory(spool)


def conclude(folder: Path, mode: Mode) -> FinishedRun | None:
    """Sum up what was recorded of a run; None if there is nothing to sum up."""
    try:
        spool = read_spool(folder / SPOOL)
    except (OSError, ValueError):  # Not even its beginning was written.
        return None
    run = recorded_trajectory(spool) if spool.ticks else None
    if run is None or not run.ticks:
        return None
    digest, times = logical_sha256(spool), realtime_times(spool)
    return FinishedRun(spool, run, summary(run, mode=mode, logical_sha256=digest, realtime=times))


def write(concluded: FinishedRun, folder: Path, on_tick: Callable[[int], None]) -> Iterator[Path]:
    """Write `summary.json`, then `run.mcap`; give each when it is there.

    Raises OSError, or `UnreadableError` when what boards have said cannot have come from boards.
    """
    write_summary(folder / SUMMARY, concluded.summary)
    yield folder / SUMMARY
    rescue(concluded.spool, folder / MCAP, on_tick, concluded.trajectory)
    if concluded.spool.complete:
        with suppress(OSError):  # It does no harm if it stays.
            (folder / SPOOL).unlink()
    yield folder / MCAP


def table(runs: Sequence[Summary]) -> Group:
    """Table II for a run of either controller, or for both."""
    by_controller = {run["controller"]: run for run in runs}
    found = report(by_controller.get("original"), by_controller.get("distributed"))
    for run in runs:
        if run["realtime"] is not None:
            found.renderables.append(realtime_table(run["realtime"]))
    return found


def paper_figures(original: Trajectory, distributed: Trajectory, folder: Path) -> list[Path]:
    """Draw the paper's three panels for each controller, and both in one picture."""
    return [
        *figures.panels(original, folder / "original"),
        *figures.panels(distributed, folder / "distributed"),
        *figures.comparison(original, distributed, folder / "comparison"),
    ]
