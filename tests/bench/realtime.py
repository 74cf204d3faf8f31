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
        if hogs:
            children = stack.enter_context(Children(Path(name)))
            for core in os.sched_getaffinity(0):
                children.start(f"hog-{core}", HOG)
        about = played(hertz, Path(name) / "run", f"run.duration_s={DURATION_S:g}")["realtime"]
        return figures(about)


def played(hertz: int, out: Path, *settings: str) -> dict[str, Any]:
    """Run the paper's movement by the wall clock; its summary. Raises `ChildFailedError`."""
    words = ["run", "paper", "--realtime", "--out", str(out)]
    for setting in (f"realtime.rate_hz={hertz}", *settings):
        words += ["--set", setting]
    done = subprocess.run(
        [sys.executable, "-m", "deploy", *words], capture_output=True, text=True, check=False
    )
    if not (out / "summary.json").exists():
        raise ChildFailedError(done.stderr.strip().splitlines()[-1])
    summary: dict[str, Any] = json.loads((out / "summary.json").read_bytes())
    return summary


def worst(about: dict[str, Any], name: str, key: str) -> float:
    """What the board says that is worst off; one that has nothing to say counts as 0."""
    return max(float(board[name][key] or 0.0) for board in about["boards"].values())


def figures(about: dict[str, Any]) -> Figures:
    """What a summary says of a run in realtime; times are those of the board that is worst off."""
    times = {f"{name}_{key}": worst(about, name, key) for name in TIMES for key in ("p50", "p99")}
    return {MAIN: float(about[MAIN]), **times}
