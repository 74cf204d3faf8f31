"""`make bench`: speed and memory of decmesh, as ratios measured side by side.

Nothing here passes or fails: machines differ, and so do their moods. What is compared is run in
turn, A B A B, and quoted as the median and the range of the ratio.
"""

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from deploy.rigs import claim
from deploy.scenario import load
from deploy.twin import Twin
from protocol.scenario import canonical

REPEATS = 5
TICKS = 5000
OURS = [f"run.duration_s={TICKS / 1000}"]


def main() -> None:
    """Measure, and print one table."""
    out = Console()
    table = Table("", "median", "min", "max", title="decmesh, 3 boards, link frames every tick")
    with TemporaryDirectory() as name:
        folder = Path(name)
        floor, tuned, ours = interleaved(
            lambda: bare_zenoh(folder, tuned=False),
            lambda: bare_zenoh(folder, tuned=True),
            lambda: lockstep(folder),
        )
        twin = repeated(in_twin)
        enrolled = repeated(lambda: start_to_enrolled(folder)[0])
        memory = repeated(lambda: start_to_enrolled(folder)[1])
        cold = repeated(lambda: cold_start(folder))
    for row in (
        ("bare Zenoh as it comes, nothing computed, ticks/s", floor, 0),
        ("bare Zenoh with the settings of decmesh, ticks/s", tuned, 0),
        ("decmesh in processes, recording off, ticks/s", ours, 0),
        ("  of bare Zenoh as it comes", ratio(ours, floor), 2),
        ("  of bare Zenoh with its settings", ratio(ours, tuned), 2),
        ("twin, frames encoded and decoded, ticks/s", twin, 0),
        ("a board: started to enrolled, s", enrolled, 3),
        ("a board: resident memory, MB", memory, 1),
        ("decmesh run of one tick, started to result, s", cold, 2),
    ):
        label, values, decimals = row
        spread = statistics.median(values), min(values), max(values)
        table.add_row(label, *(f"{value:,.{decimals}f}" for value in spread))
    out.print(table)
    load_average = os.getloadavg()[0]
    out.print(
        f"{REPEATS} repeats; Python {platform.python_version()}, zenoh {version('eclipse-zenoh')},"
        f" {os.cpu_count()} cores of {processor()}, load {load_average:.1f}"
    )


def repeated(measure: Callable[[], float]) -> list[float]:
    """Measure a few times."""
    return [measure() for _ in range(REPEATS)]


def interleaved(*measures: Callable[[], float]) -> list[list[float]]:
    """Measure several things in turn, so that all see the same machine."""
    rounds = [[measure() for measure in measures] for _ in range(REPEATS)]
    return [list(values) for values in zip(*rounds, strict=True)]


def ratio(ours: list[float], theirs: list[float]) -> list[float]:
    """Compare what was measured in the same round."""
    return [a / b for a, b in zip(ours, theirs, strict=True)]


def bare_zenoh(folder: Path, *, tuned: bool) -> float:
    """Ticks per second of the floor."""
    with claim(load("paper"), folder) as placed:
        port = str(placed.values["rig"]["base_port"])
        words = [port, str(TICKS), str(int(tuned))]
        return race([["tests.bench.floor", str(role), *words] for role in range(4)])


def lockstep(folder: Path) -> float:
    """Ticks per second of plant and boards, recording off."""
    with claim(load("paper", OURS), folder) as placed:
        file = folder / "scenario.json"
        file.write_bytes(canonical(placed.values))
        boards = [["module_agent", joint, "--scenario", str(file)] for joint in placed.joints]
        return race([["plant_server", "--scenario", str(file), "--progress"], *boards])


def race(modules: list[list[str]]) -> float:
    """Run the plant (the first) and the boards; it prints ticks and seconds last."""
    children = [
        subprocess.Popen([sys.executable, "-m", *module], stdout=subprocess.PIPE, text=True)
        for module in modules
    ]
    said = [child.communicate()[0] for child in children]
    ticks, seconds = said[0].splitlines()[-1].split()
    return float(ticks) / float(seconds)


def in_twin() -> float:
    """Ticks per second of the twin."""
    twin = Twin(load("paper", OURS))
    started = time.perf_counter()
    ticks = sum(1 for _ in twin.run())
    return ticks / (time.perf_counter() - started)


def start_to_enrolled(folder: Path) -> tuple[float, float]:
    """Seconds from a board's start until it is enrolled at a waiting plant; and its memory, MB."""
    with claim(load("paper"), folder) as placed:
        file = folder / "scenario.json"
        file.write_bytes(canonical(placed.values))
        plant = start(["plant_server", "--scenario", str(file)])
        assert plant.stderr is not None
        plant.stderr.readline()  # It waits for its boards: it is ready for them.
        started = time.perf_counter()
        board = start(["module_agent", "hip", "--scenario", str(file)])
        plant.stderr.readline()  # It waits for the others.
        elapsed_s = time.perf_counter() - started
        memory_mb = resident_mb(board.pid)
        for process in (board, plant):
            process.terminate()
            process.communicate()
    return elapsed_s, memory_mb


def cold_start(folder: Path) -> float:
    """Seconds from calling `decmesh run` to the result of a run of one tick."""
    target = folder / f"run{time.perf_counter_ns()}"
    command = [sys.executable, "-m", "deploy", "run", "paper", "--out", str(target)]
    started = time.perf_counter()
    options = ["--set", "run.duration_s=0.001"]
    subprocess.run([*command, *options], check=True, capture_output=True)
    return time.perf_counter() - started


def start(module: list[str]) -> subprocess.Popen[str]:
    """Start a process whose standard error can be read."""
    return subprocess.Popen([sys.executable, "-m", *module], stderr=subprocess.PIPE, text=True)


def resident_mb(pid: int) -> float:
    """Resident memory of a process (Linux)."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) / 1024.0
    raise RuntimeError(f"process {pid} has no memory")


def processor() -> str:
    """Name of the processor (Linux), or what Python knows of it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


if __name__ == "__main__":
    main()
