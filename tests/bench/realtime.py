"""Real time: how often a deadline is missed, how old data is, and how long agreement takes.

Everything comes from the key `realtime` of a run's `summary.json`: every number in it is a figure,
those of tables in it with the table's name before theirs. `MAIN` is the one that is shown first.
"""

import json
import os
import subprocess
import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.bench.children import ChildFailedError, Children
from tests.bench.registry import Contender, Figures, Group, Settings

RATES_HZ = (200, 500, 1000)
DURATION_S = 5.0
MAIN = "missed_share"
HOG = [sys.executable, "-c", "while True: pass"]


def group(_settings: Settings) -> Group:
    """Three rates, with the cores for itself and with a process on each core that never rests."""
    return Group(
        "realtime",
        "real time, share of deadlines missed",
        [
            Contender(
                f"{hertz} Hz, {'beside CPU hogs' if hogs else 'quiet'}",
                partial(run, hertz, hogs=hogs),
            )
            for hertz in RATES_HZ
            for hogs in (False, True)
        ],
    )


def run(hertz: int, *, hogs: bool) -> Figures:
    """One run in wall time; the numbers of its summary."""
    with TemporaryDirectory(prefix="decmesh-bench-") as name, ExitStack() as stack:
        out = Path(name) / "run"
        if hogs:
            children = stack.enter_context(Children(Path(name)))
            for core in os.sched_getaffinity(0):
                children.start(f"hog-{core}", HOG)
        settings = [f"realtime.rate_hz={hertz}", f"run.duration_s={DURATION_S:g}"]
        words = ["run", "paper", "--realtime", "--out", str(out)]
        words += [word for setting in settings for word in ("--set", setting)]
        done = subprocess.run(
            [sys.executable, "-m", "deploy", *words], capture_output=True, text=True, check=False
        )
        if not (out / "summary.json").exists():
            raise ChildFailedError(done.stderr.strip().splitlines()[-1])
        about = json.loads((out / "summary.json").read_bytes())["realtime"]
        figures = dict(_numbers(about))
        main = {MAIN: figures.pop(MAIN)} if MAIN in figures else {}
        return {**main, **figures}


def _numbers(tree: dict[str, Any], prefix: str = "") -> list[tuple[str, float]]:
    """Every number of a table, by its path."""
    found: list[tuple[str, float]] = []
    for key, value in tree.items():
        if isinstance(value, dict):
            found += _numbers(value, f"{prefix}{key}_")
        elif isinstance(value, int | float):
            found.append((f"{prefix}{key}", float(value)))
    return found
