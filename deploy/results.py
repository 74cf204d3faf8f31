"""From a run's spool to its results. Imports numpy, so it is imported when the run is over."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Group

from deploy import figures
from deploy.processes import SPOOL
from deploy.realtime_summary import realtime_summary
from deploy.realtime_table import realtime_table
from deploy.run import SUMMARY
from deploy.summary import Mode, Summary, summary, write_summary
from deploy.table import report
from deploy.trajectory import Trajectory, trajectory
from plant_server.spool import Spool, read_spool


def read_run(folder: Path) -> Trajectory | None:
    """Read a run back from its folder; None if it never got as far as an end."""
    return _trajectory(read_spool(folder / SPOOL))


def _trajectory(spool: Spool) -> Trajectory | None:
    if spool.outcome is None or spool.outcome.tick <= 0:
        return None
    return trajectory(spool.scenario, spool.ticks, spool.outcome)


def conclude(folder: Path, mode: Mode) -> tuple[Trajectory, Summary] | None:
    """Write `summary.json` for a run; None if there is nothing to sum up."""
    spool = read_spool(folder / SPOOL)
    run = _trajectory(spool)
    if run is None:
        return None
    values = summary(run, mode=mode, realtime=realtime_summary(spool))
    write_summary(folder / SUMMARY, values)
    return run, values


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
