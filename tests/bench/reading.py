"""What comes after a run: the time from its last tick to the end of the command, and of a report.

Both are told per second of the body. Commands are started as a user does: what they import counts.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from deploy.cli import main
from deploy.recording.reading import read_recording
from plant_server.session.record import Outcome
from plant_server.spool.spool import SpoolWriter
from tests.bench.registry import Contender, Figures, Group, Settings

SCENARIO = "paper"
TICKS_PER_S = 1000


class FinishedRun(NamedTuple):
    """A run that is over."""

    folder: Path
    last_tick_ns: int
    """Monotonic time of the end of its last tick."""
    ended_ns: int
    """When the command had ended."""


def group(settings: Settings) -> Group:
    """Recordings of processes and of the twin."""
    seconds = 2 * settings.ticks / TICKS_PER_S  # Of all groups 10 s, as long as the scenario is.

    def contender(what: str, measure: Callable[[FinishedRun], float], *, twin: bool) -> Contender:
        where = "in the twin" if twin else "in processes"
        return Contender(f"{what} {where}", partial(_measured, measure, seconds, twin=twin))

    return Group(
        "reading",
        "after a run: seconds of the wall per second of the body",
        [
            contender(what, measure, twin=twin)
            for what, measure in (("report of a run", _report_s), ("tail of a run", _tail_s))
            for twin in (False, True)
        ],
    )


def _measured(measure: Callable[[FinishedRun], float], seconds: float, *, twin: bool) -> Figures:
    with TemporaryDirectory(prefix="decmesh-bench-") as folder:
        return {"s_per_s": measure(_run(Path(folder), seconds, twin=twin)) / seconds}


def _run(folder: Path, seconds: float, *, twin: bool) -> FinishedRun:
    out, stamp = folder / "run", folder / "last_tick"
    words = ["run", SCENARIO, "--set", f"run.duration_s={seconds}", "--out", str(out), "--json"]
    command = [sys.executable, "-m", "tests.bench.reading", str(stamp), *words]
    subprocess.run([*command, *["--twin"] * twin], check=True, stdout=subprocess.DEVNULL)
    ended_ns = time.monotonic_ns()
    # A plant tells when it closed each tick; the twin has no times, so it is watched.
    last_ns = int(stamp.read_text()) if twin else int(read_recording(out).closed_ns[-1])
    return FinishedRun(out, last_ns, ended_ns)


def _report_s(run: FinishedRun) -> float:
    started_s = time.perf_counter()
    command = [sys.executable, "-m", "deploy", "report", str(run.folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started_s


def _tail_s(run: FinishedRun) -> float:
    return (run.ended_ns - run.last_tick_ns) / 1e9


def _watched(stamp: Path) -> None:
    """Run the command line, and leave when a spool in this process was closed."""
    close = SpoolWriter.close

    def closed(self: SpoolWriter, outcome: Outcome | None) -> None:
        if outcome is not None:
            stamp.write_text(str(time.monotonic_ns()))
        close(self, outcome)

    setattr(SpoolWriter, "close", closed)  # noqa: B010 - so it is for the types as well
    main()


if __name__ == "__main__":
    _watched(Path(sys.argv.pop(1)))
