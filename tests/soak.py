"""`python -m tests.soak --minutes 10`: whether memory stays flat while a robot runs at full rate.

First in the twin: every element that boards and plant keep is counted, early and much later. Then
in processes, as fast as the barrier goes, recording off: resident memory of each, every few
seconds, and a straight line through what comes after the warm-up.

An allocator takes and gives back in steps, so a line through a few minutes is never quite level.
What is kept by mistake is kept in every tick, and Python keeps nothing in less than some 30 bytes.
The bound is far below that.
"""

import argparse
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import linear_regression
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import psutil
from rich.console import Console
from rich.table import Table

from deploy.launch.rigs import claim
from deploy.launch.twin import Twin
from deploy.scenario_file.load import load
from protocol.robot.scenario import canonical

SAMPLE_EVERY_S = 5.0
WARM_UP_SHARE = 0.3
"""Of the samples: caches fill, and the allocator takes what it will need."""
BYTES_PER_TICK_MAX = 1.0
EARLY_TICKS, LATE_TICKS = 2_016, 12_000
"""When elements are counted in the twin: all delay lines are full by then, and 100 epochs later.
Both are as long after boards have forgotten old samples, which they do every 32 ticks."""
FOR_EVER = "run.duration_s=100000"


# --- In the twin: what is kept -------------------------------------------------------------------


def growing(
    scenario: str, early_ticks: int = EARLY_TICKS, late_ticks: int = LATE_TICKS
) -> dict[str, tuple[int, int]]:
    """Containers that keep something of every epoch, or of more: where, and how much both times."""
    twin = Twin(load(scenario, [FOR_EVER]))
    kept = []
    for ticks in (early_ticks, late_ticks - early_ticks):
        for _ in range(ticks):
            twin.tick()
        kept.append(elements(twin))
    early, late = kept
    epochs = (late_ticks - early_ticks) // twin.scenario.election.period_ticks
    return {
        path: (early[path], late[path])
        for path in late
        # What is bounded breathes a little under loss.
        if late[path] - early[path] > max(0.6 * epochs, 0.15 * early[path])
    }


def elements(root: object) -> Counter[str]:
    """How many elements the containers below an object have, summed up by where they are."""
    counts: Counter[str] = Counter()
    seen: set[int] = set()
    waiting: deque[tuple[str, Any]] = deque([(type(root).__name__, root)])
    while waiting:
        path, thing = waiting.popleft()  # By the shortest way to it.
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, bytes | str):
            counts[path] += len(thing)
        elif isinstance(thing, list | tuple | set | frozenset | deque):
            counts[path] += len(thing)
            waiting.extend((f"{path}[]", inner) for inner in thing)
        elif isinstance(thing, dict):
            counts[path] += len(thing)
            waiting.extend((f"{path}[]", inner) for pair in thing.items() for inner in pair)
        elif not isinstance(thing, type):
            waiting.extend((f"{path}.{name}", inner) for name, inner in attributes(thing))
    return counts


def attributes(thing: object) -> Iterator[tuple[str, object]]:
    """What an object has, whether by slots or not."""
    yield from getattr(thing, "__dict__", {}).items()
    for owner in type(thing).__mro__:
        slots = owner.__dict__.get("__slots__", ())
        for name in [slots] if isinstance(slots, str) else slots:
            if hasattr(thing, name):
                yield name, getattr(thing, name)


# --- In processes: what the operating system says ------------------------------------------------


class Sample(NamedTuple):
    """Memory of every process at one moment."""

    elapsed_s: float
    tick: int
    resident_kb: dict[str, int]


class Line(NamedTuple):
    """What a process did after the warm-up."""

    first_kb: int
    last_kb: int
    kb_per_min: float
    bytes_per_tick: float

    @property
    def flat(self) -> bool:
        return self.bytes_per_tick <= BYTES_PER_TICK_MAX


class Robot:
    """Plant and boards, started by hand; the plant says how far it is."""

    def __init__(self, file: Path, joints: list[str]) -> None:
        words = {"plant": ["plant_server", "--progress"]}
        words |= {joint: ["module_agent", joint] for joint in joints}
        self.tick = 0
        self.processes = {
            name: subprocess.Popen(
                [sys.executable, "-m", *command, "--scenario", str(file), "--lifeline"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for name, command in words.items()
        }
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self) -> None:
        stdout = self.processes["plant"].stdout
        assert stdout is not None
        for line in stdout:
            self.tick = int(line.split()[0])

    def sample(self, elapsed_s: float) -> Sample:
        resident = {name: resident_kb(process.pid) for name, process in self.processes.items()}
        return Sample(elapsed_s, self.tick, resident)

    def stop(self) -> None:
        for process in self.processes.values():
            process.terminate()
        for process in self.processes.values():
            process.wait()


@contextmanager
def running(scenario: str) -> Iterator[Robot]:
    """A robot under way."""
    with TemporaryDirectory() as name, claim(load(scenario, [FOR_EVER]), Path(name)) as placed:
        file = Path(name) / "scenario.json"
        file.write_bytes(canonical(placed))
        robot = Robot(file, placed.joints)
        try:
            while robot.tick == 0:
                time.sleep(0.05)
            yield robot
        finally:
            robot.stop()


def soak(scenario: str, seconds: float) -> list[Sample]:
    """Run for so long, and look now and then."""
    samples = []
    with running(scenario) as robot:
        started = time.monotonic()
        while (elapsed_s := time.monotonic() - started) < seconds:
            samples.append(robot.sample(elapsed_s))
            time.sleep(SAMPLE_EVERY_S)
        samples.append(robot.sample(time.monotonic() - started))
    return samples


def line(samples: list[Sample], name: str) -> Line:
    """The least-squares line through what comes after the warm-up."""
    settled = samples[int(len(samples) * WARM_UP_SHARE) :]
    resident = [sample.resident_kb[name] for sample in settled]
    kb_per_s = linear_regression([sample.elapsed_s for sample in settled], resident).slope
    ticks_per_s = (settled[-1].tick - settled[0].tick) / (
        settled[-1].elapsed_s - settled[0].elapsed_s
    )
    per_tick = 1024.0 * kb_per_s / ticks_per_s
    return Line(resident[0], resident[-1], 60.0 * kb_per_s, per_tick)


def resident_kb(pid: int) -> int:
    """Resident memory of a process."""
    return psutil.Process(pid).memory_info().rss // 1024


def main() -> int:
    """Soak, print what came out, and return 0 if all of it is flat."""
    options = argparse.ArgumentParser(prog="python -m tests.soak")
    options.add_argument("--minutes", type=float, default=10.0)
    options.add_argument("--scenario", default="paper", help="one without boards that are pulled")
    arguments = options.parse_args()
    out = Console()
    grown = growing(arguments.scenario)
    for path, (early, late) in grown.items():
        out.print(f"{path}: {early} elements early, {late} late", highlight=False, markup=False)
    samples = soak(arguments.scenario, 60.0 * arguments.minutes)
    settled, last = samples[int(len(samples) * WARM_UP_SHARE)], samples[-1]
    title = f"{last.elapsed_s / 60.0:.1f} minutes of {arguments.scenario}, {last.tick:,} ticks"
    columns = (
        "process",
        f"at {settled.elapsed_s:.0f} s, kB",
        "end, kB",
        "kB/min",
        "bytes/tick",
        "",
    )
    table = Table(*columns, title=title)
    lines = {name: line(samples, name) for name in last.resident_kb}
    for name, (first_kb, last_kb, kb_per_min, per_tick) in lines.items():
        verdict = "flat" if lines[name].flat else "grows"
        table.add_row(
            name, f"{first_kb:,}", f"{last_kb:,}", f"{kb_per_min:.1f}", f"{per_tick:.3f}", verdict
        )
    out.print(table)
    flat = not grown and all(one.flat for one in lines.values())
    out.print(f"containers {'grow' if grown else 'are bounded'}; {'flat' if flat else 'not flat'}")
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
