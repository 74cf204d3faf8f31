"""Hunts for bugs: `python -m tests.sim --seeds 1000`, and `--seed N` to replay one."""

import argparse
import signal
import sys
import traceback
from multiprocessing import Pool, cpu_count

from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

from tests.sim.hunt import Found, Game, find
from tests.sim.plans import plan

SHOWN_MAX = 20
CHUNK = 8


def main() -> int:
    """Read the options; 0: no law broken, 1: one was, 130: interrupted before any was."""
    options = argparse.ArgumentParser(prog="python -m tests.sim", description=__doc__)
    options.add_argument("--seeds", type=int, default=1000, help="how many to play")
    options.add_argument("--first", type=int, default=0, help="the first of them")
    options.add_argument("--jobs", type=int, default=cpu_count(), help="processes")
    options.add_argument("--seed", type=int, help="replay this one, with its traceback")
    arguments = options.parse_args()
    if arguments.seed is not None:
        return replay(arguments.seed)
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    return hunt(seeds, arguments.jobs)


def hunt(seeds: range, jobs: int) -> int:
    """Play many seeds on all cores, and tell what they found."""
    found: list[Found] = []
    interrupted = False
    columns = (*Progress.get_default_columns()[:3], MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn()) as progress, Pool(jobs, _deaf) as pool:
        task = progress.add_task("seeds", total=len(seeds))
        try:
            for one in pool.imap_unordered(find, seeds, chunksize=CHUNK):
                found.append(one)
                progress.advance(task)
                if one.broken and sum(bool(other.broken) for other in found) <= SHOWN_MAX:
                    progress.console.print(_line(one), markup=False, highlight=False)
        except KeyboardInterrupt:
            interrupted = True
            pool.terminate()
    broken = sorted(one.seed for one in found if one.broken)
    print(
        f"{len(found)} seeds, {sum(one.ticks for one in found)} ticks,"
        f" {sum(one.claimed_epochs for one in found)} epochs in which S13 is claimed,"
        f" {sum(one.fell for one in found)} falls, {len(broken)} broken laws"
    )
    if broken:
        return 1
    return 130 if interrupted else 0


def _deaf() -> None:
    """Ctrl-C is for the process that started the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def replay(seed: int) -> int:
    """Play one seed, and show where it breaks."""
    one = find(seed)
    print(_line(one) if one.broken else f"seed {seed}: {one.ticks} ticks, no law broken")
    if one.broken:
        try:
            Game(plan(seed)).play()
        except Exception:  # noqa: BLE001 - shown for whoever looks for the cause.
            traceback.print_exc()
    return int(bool(one.broken))


def _line(one: Found) -> str:
    return f"seed {one.seed}, {one.broken}\n  replay: python -m tests.sim --seed {one.seed}"


if __name__ == "__main__":
    sys.exit(main())
