"""Real time: how often a deadline is missed, how old data is, and how long agreement takes.

Everything comes from the key `realtime` of a run's `summary.json`, which has much more.
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
TIMES = ("observation_age_ms", "torque_age_ms", "decision_ms")
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
        return figures(json.loads((out / "summary.json").read_bytes())["realtime"])


def figures(about: dict[str, Any]) -> Figures:
    """What a summary says of a run in realtime; times are those of the board that is worst off."""
    boards = list(about["boards"].values())
    worst = {
        f"{name}_{key}": max(float(board[name][key] or 0.0) for board in boards)
        for name in TIMES
        for key in ("p50", "p99")
    }
    return {MAIN: float(about[MAIN]), **worst}
