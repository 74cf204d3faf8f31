"""`make bench`: what decmesh costs, and what others cost that do the same.

Nothing here passes or fails: machines differ, and so do their moods. Whatever is compared is run in
turn, A B A B, and quoted as median and range. `tests/bench/README.md` says what each number means.
"""

import argparse
import os
import sys
import time
from pathlib import Path

from rich.console import Console

from tests.bench import (
    growth,
    ours,
    path,
    plant,
    plot,
    reading,
    realtime,
    same_job,
    startup,
    turning,
    twin,
)
from tests.bench.children import FIFO
from tests.bench.compare import compare
from tests.bench.machine import machine
from tests.bench.measure import measure
from tests.bench.registry import FULL, QUICK, Group, Settings
from tests.bench.results import Results
from tests.bench.table import comparison_table, footnotes, markdown, result_table

GROUPS = {
    "systems": same_job.group,
    "decmesh": ours.group,
    "twin": twin.group,
    "plant": plant.group,
    "growth": growth.in_twin,
    "processes": growth.processes,
    "start": startup.group,
    "memory": startup.memory,
    "path": path.group,
    "realtime": realtime.group,
    "reading": reading.group,
    "knobs": turning.ours,
    "knobs-bare": turning.bare,
}
ON_REQUEST = {"knobs", "knobs-bare"}
"""Groups that are measured only when they are named."""


def main() -> int:
    """Measure, show, and write down."""
    arguments = _arguments()
    console = Console(width=None if sys.stdout.isatty() else 140)
    try:
        then = None if arguments.compare is None else Results.read(arguments.compare)
        folder = arguments.out or Path("runs") / f"bench-{time.strftime('%Y%m%d-%H%M%S')}"
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 2
    # Brokers and daemons that came with a package lie beside Python.
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # Nobody starts without compiled files.
    settings = QUICK if arguments.quick else FULL
    if arguments.repeats is not None:
        settings = settings._replace(repeats=arguments.repeats)
    names = arguments.only or [name for name in GROUPS if name not in ON_REQUEST]
    if arguments.fifo:
        os.environ[FIFO] = "1"
    results = Results(machine(), {**settings._asdict(), "fifo": arguments.fifo})
    stopped = _measure([GROUPS[name](settings) for name in names], settings, results)
    results.write(folder / "bench.json")
    (folder / "bench.md").write_text(markdown(results))
    plot.picture(results, folder / "bench.png")
    console.print(result_table(results))
    for line in footnotes(results):
        console.print(line, highlight=False)
    if then is not None:
        changes = compare(then, results)
        same = sum(change.verdict == "same" for change in changes)
        console.print(comparison_table(changes))
        console.print(f"{same} of {len(changes)} figures are the same as in {arguments.compare}")
    console.print(f"{folder}/bench.json, bench.md, bench.png")
    return 130 if stopped else 0


def _measure(groups: list[Group], settings: Settings, results: Results) -> bool:
    """Measure group by group; tell whether it was stopped, in which case it keeps what there is."""
    started = time.monotonic()

    def tell(line: str) -> None:
        elapsed_s = int(time.monotonic() - started)
        told = f"[{elapsed_s // 60}:{elapsed_s % 60:02d}, load {os.getloadavg()[0]:.1f}] {line}"
        print(told, file=sys.stderr, flush=True)

    for group in groups:
        try:
            results.groups[group.name] = measure(group, settings.repeats, tell)
        except KeyboardInterrupt:
            tell(f"stopped; {group.name} is left out")
            return True
    return False


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench",
        description="Measure decmesh beside other systems. Let nothing else run meanwhile.",
        epilog="Example: python -m tests.bench --only plant twin --compare runs/bench-1/bench.json",
    )
    parser.add_argument(
        "--only", nargs="+", choices=GROUPS, metavar="GROUP", help=f"of {', '.join(GROUPS)}"
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer ticks and repeats: a first look"
    )
    parser.add_argument(
        "--repeats", type=int, metavar="N", help="how often all is measured in turn"
    )
    parser.add_argument(
        "--fifo",
        action="store_true",
        help="run plants, boards and brokers under SCHED_FIFO, as a busy machine needs; as root",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="FILE", help="tell what has changed since that bench.json"
    )
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where to write; else in runs/")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
