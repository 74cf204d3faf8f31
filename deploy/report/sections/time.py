"""Where the wall time of a run went: ticks, the board that was waited for, and the processes."""

from collections.abc import Sequence

from deploy.recording.latency import gaps_ns, ticks_ns, waits
from deploy.report.charts import spreads as charts
from deploy.report.charts.spreads import Group, log_limits
from deploy.report.page import Block, PageTable, Section
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun, remarks
from deploy.report.sections.run_table import (
    NO_BARRIER,
    NO_WALL_TIME,
    NONE,
    NS_PER_MS,
    SPREAD_HEADER,
    run_table,
    spread_cells,
)


def effort(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """Times and effort, as figures and as numbers; or why there are none."""
    ticking = [run for run in runs if not run.in_realtime]
    timed = [run for run in ticking if run.timed]
    taken_ms = {run.number: ticks_ns(run.recording) / NS_PER_MS for run in timed}
    shared = log_limits(list(taken_ms.values()))
    blocks: list[Block] = []
    if shared is not None:
        blocks += pictures.each(
            "ticks",
            timed,
            lambda run: charts.histogram(
                [Group("", "0.6", taken_ms[run.number])], shared, "Tick (ms, logarithmic)"
            ),
            title="Wall time of a tick",
            reading="How often (up) a tick took how long (right), from its opening by the plant"
            " until the last answer was in.",
        )
        blocks += pictures.each(
            "waits",
            timed,
            lambda run: charts.waited_for(waits(run.recording).last, run.joints),
            title="For whom the plant waited",
            reading="A bar is the share of ticks in which that board was the last to answer: with"
            " boards that are equally fast, all are about as long.",
        )
        blocks += [_time_table(runs, timed), _waits_table(runs, timed)]
        blocks += _effort_table(runs, timed)
    blocks += remarks(runs, [run for run in ticking if not run.timed], NO_WALL_TIME)
    blocks += remarks(runs, [run for run in runs if run.in_realtime], NO_BARRIER)
    return Section("time", "Time and effort", blocks)


def _time_table(runs: Sequence[ReportedRun], timed: Sequence[ReportedRun]) -> PageTable:
    rows = [
        (run, [name, *spread_cells(values_ns / NS_PER_MS, ".3f")])
        for run in timed
        for name, values_ns in (
            ("a tick", ticks_ns(run.recording)),
            ("between two ticks", gaps_ns(run.recording)),
        )
    ]
    return run_table(
        runs,
        "Wall time of ticks, in ms",
        "A tick is open while boards think and speak; between two ticks the plant moves the body"
        " on, and waits where a board is to be put in or taken away.",
        ["what", *SPREAD_HEADER],
        rows,
    )


def _waits_table(runs: Sequence[ReportedRun], timed: Sequence[ReportedRun]) -> PageTable:
    rows = []
    for run in timed:
        found = waits(run.recording)
        for board, joint in enumerate(run.joints):
            share = 100.0 * found.last[board] / max(found.ticks, 1)
            _known, *alone = spread_cells(found.alone_ns[found.whose == board] / NS_PER_MS, ".3f")
            rows.append((run, [joint, f"{found.last[board]:,}", f"{share:.1f} %", *alone]))
    return run_table(
        runs,
        "Who answered last",
        "In how many ticks each board was the last, and for how many ms the plant then waited for"
        " it alone.",
        ["board", "ticks", "share", *SPREAD_HEADER[1:]],
        rows,
    )


def _effort_table(runs: Sequence[ReportedRun], timed: Sequence[ReportedRun]) -> list[PageTable]:
    rows = []
    for run in timed:
        wall_s = run.summary["wall_s"]
        for name, (cpu_s, memory_mb) in run.recording.processes.items():
            share = f"{100.0 * cpu_s / wall_s:.0f} %" if wall_s else NONE
            rows.append((run, [name, f"{cpu_s:.2f}", share, f"{memory_mb:.1f}"]))
    if not rows:
        return []
    return [
        run_table(
            runs,
            "What the processes used",
            "Processor seconds of each process, start-up included, beside the wall time from the"
            " release of the body to the end; and the most memory that it held.",
            ["process", "CPU (s)", "of the wall time", "memory (MB)"],
            rows,
        )
    ]
