"""`python -m tests.bench.realtime_table`: the table of README's section on realtime.

The paper's movement at three rates, several runs each, all rates in turn. A cell is the median over
the runs of what the board says that is worst off; the share of deadlines missed is that of all
boards together, with its least and largest.
"""

import argparse
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from plant_server.session.record import COMPLETE
from tests.bench.realtime import RATES_HZ, played, worst

HEADER = (
    "| loops | deadlines missed | period p99 | observation age p50 / p99 | torque age p50 / p99 |"
    " decision p50 / p99 | exactly one enabled | TS overshoot |\n"
    "|---|---|---|---|---|---|---|---|"
)
Summary = dict[str, Any]


def row(hertz: int, runs: list[Summary]) -> str:
    """The table's row of a rate."""

    def usual(name: str, key: str) -> float:
        return median(worst(run["realtime"], name, key) for run in runs)

    def both(name: str) -> str:
        return f"{usual(name, 'p50'):.1f} / {usual(name, 'p99'):.1f} ms"

    def over(of: Callable[[Summary], float]) -> list[float]:
        return sorted(map(of, runs))

    missed = over(lambda run: 100.0 * run["realtime"]["missed_share"])
    one = over(lambda run: 100.0 * run["consensus"]["enabled_1"] / run["consensus"]["epochs"])
    overshoot = over(lambda run: run["indices"]["TS"]["overshoot_deg"])
    cells = [
        f"{hertz} Hz",
        f"{median(missed):.2f} % ({missed[0]:.2f} to {missed[-1]:.2f})",
        f"{usual('period_ms', 'p99'):.1f} ms",
        both("observation_age_ms"),
        both("torque_age_ms"),
        both("decision_ms"),
        f"{median(one):.0f} % of epochs",
        f"{median(overshoot):.2f}°",
    ]
    return f"| {' | '.join(cells)} |"


def table(repeats: int) -> Iterator[str]:
    """Measure, and write it down."""
    runs: dict[int, list[Summary]] = {hertz: [] for hertz in RATES_HZ}
    with TemporaryDirectory(prefix="decmesh-realtime-") as name:
        for repeat in range(repeats):
            for hertz, found in runs.items():
                summary = played(hertz, Path(name) / f"{hertz}-{repeat}")
                assert summary["ending"] == COMPLETE, "a body that has fallen tells of other things"
                found.append(summary)
    yield HEADER
    for hertz, found in runs.items():
        yield row(hertz, found)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.realtime_table")
    parser.add_argument("--repeats", type=int, default=5, help="runs for each rate")
    loads = [os.getloadavg()[0]]
    for line in table(parser.parse_args().repeats):
        print(line)
    loads.append(os.getloadavg()[0])
    print(f"{len(os.sched_getaffinity(0))} cores, load {loads[0]:.1f} to {loads[1]:.1f}")


if __name__ == "__main__":
    main()
