"""From a run's spool to its results. Imports numpy, so it is imported when the run is over."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Group

from deploy import figures
from deploy.processes import SPOOL
from deploy.run import SUMMARY
from deploy.summary import Mode, Summary, summary, write_summary
from deploy.table import report
from deploy.trajectory import Trajectory, trajectory
from plant_server.spool import read_spool


def read_run(folder: Path) -> Trajectory | None:
    """Read a run back from its folder; None if it never got as far as an end."""
    spool = read_spool(folder / SPOOL)
    if spool.outcome is None or spool.outcome.tick <= 0:
        return None
    return trajectory(spool.scenario, spool.ticks, spool.outcome)


def conclude(folder: Path, mode: Mode) -> tuple[Trajectory, Summary] | None:
    """Write `summary.json` for a run; None if there is nothing to sum up."""
    run = read_run(folder)
    if run is None:
        return None
    values = summary(run, mode=mode)
    write_summary(folder / SUMMARY, values)
    return run, values


def table(runs: Sequence[Summary]) -> Group:
    """Table II for a run of either controller, or for both."""
    by_controller = {run["controller"]: run for run in runs}
    return report(by_controller.get("original"), by_controller.get("distributed"))


def paper_figures(original: Trajectory, distributed: Trajectory, folder: Path) -> list[Path]:
    """Draw the paper's three panels for each controller, and both in one picture."""
    return [
        *figures.panels(original, folder / "original"),
        *figures.panels(distributed, folder / "distributed"),
        *figures.comparison(original, distributed, folder / "comparison"),
    ]
