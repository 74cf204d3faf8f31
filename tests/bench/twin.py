"""The twin: plant and boards in one process, with frames encoded and decoded."""

import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from deploy.scenario import load
from deploy.twin import Twin
from plant_server.spool import SpoolWriter
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

PLAIN, RECORDED = "twin, frames encoded and decoded", "twin, recorded"


def group(settings: Settings) -> Group:
    """Three boards on one core."""
    return Group(
        "twin",
        "plant and 3 boards in one process, ticks/s",
        [
            Contender(PLAIN, partial(in_twin, settings, recorded=False)),
            Contender(RECORDED, partial(in_twin, settings, recorded=True)),
        ],
        [Ratio("recorded, of not recorded", RECORDED, PLAIN, "ticks_per_s")],
    )


def in_twin(settings: Settings, *, recorded: bool) -> Figures:
    """Play a run; its rate after the ticks that do not count."""
    scenario = load("paper", [f"run.duration_s={(settings.warm_up + settings.ticks) / 1000}"])
    with TemporaryDirectory(prefix="decmesh-bench-") as folder:
        spool = SpoolWriter(Path(folder) / "run.spool", scenario.values)
        twin = Twin(scenario)
        started, cpu_s = 0.0, 0.0
        for record in twin.run():
            if record.tick == settings.warm_up:
                started, cpu_s = time.perf_counter(), time.process_time()
            if recorded:
                spool.append(record, None)
        taken_s, cpu_s = time.perf_counter() - started, time.process_time() - cpu_s
        spool.close(twin.lockstep.outcome(taken_s))
    ticks = settings.ticks - 1  # The first is over when the clock starts.
    return {"ticks_per_s": ticks / taken_s, "cpu_us": 1e6 * cpu_s / ticks}
