"""What a report tells of a run: its motion, its elections, one epoch, and what happened to it.

Rule: a section takes all runs of the report, so that they stand beside each other by subject.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from deploy.failure import FailedError
from deploy.outcome import figures
from deploy.outcome import table_ii as table
from deploy.report.charts.spacetime import Scene, spacetime, telling_epoch
from deploy.report.charts.strips import Strips, limits, strips
from deploy.report.page import Block, Figure, PageTable, Section
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun, remarks, titled
from deploy.report.sections.foot import foot
from deploy.report.sections.run_table import NO_BARRIER
from protocol.process.exit_codes import ExitCode

FOLDED_FROM = 25
"""A table with more rows is shown when asked for."""
NOBODY_ELECTED = "All boards move all the time: nobody is elected."


def motion(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """The paper's three panels and its table, and the foot of bodies that have one."""
    motions = [(run.label if len(runs) > 1 else "", run.recording.trajectory) for run in runs]
    strip = any(run.epochs is not None for run in runs)
    panels = Figure(
        "Motion",
        "A: each link's angle from the vertical over time and, below, a bar while a board is"
        " enabled; B: the way of the centre of mass, a dot each 10 ms; C: the body at even"
        " distances along its way; B and C are light at the start and dark at the end.",
        [pictures.add("motion", partial(figures.stacked, motions, strip=strip))],
        wide=True,
    )
    return Section("motion", "Motion", [panels, _indices(runs), *foot(runs, pictures)])


def _indices(runs: Sequence[ReportedRun]) -> PageTable:
    """Table II, the paper's numbers before ours where the run is of the paper's scenario."""
    columns = [
        table.ColumnRun(int(run.summary["controller"] == "distributed"), run.summary)
        for run in runs
    ]
    papers = [run for run in columns if run.summary["scenario"] == table.PAPER_SCENARIO]
    letters = table.letters_of(papers)
    header = ["variable", "index"]
    for run, column in zip(runs, columns, strict=True):
        header += [f"published, {run.summary['controller']}"] * (column in papers) + [run.label]
    rows = []
    for name, indices in table.sections(columns):
        for index in indices:
            cells = [name or "energy", index.label.removeprefix("energy, ")]
            for column in columns:
                if column in papers:
                    cells += [cell.plain for cell in table.cells(name, index, column, letters)]
                else:
                    ours = table.value_of(name, index.key, column)
                    cells.append(table.written(index, ours))
            rows.append(cells)
    return PageTable(
        "Dynamic performance",
        "Each controlled variable's overshoot past its goal, rise and settling, and the work of all"
        " joints: the indices of the paper's Table II, of which smaller is better.",
        header,
        rows,
        notes=table.notes_on(papers),
        texts=frozenset({0, 1}),
        folded=len(rows) > FOLDED_FROM,
    )


def elections(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """Who was enabled, w, rounds, frames and faults over time."""
    drawn = {run.number: Strips(run.recording, run.epochs, run.happened) for run in runs}
    shared = limits(list(drawn.values()))
    over_time = pictures.each(
        "elections",
        runs,
        lambda run: strips(drawn[run.number], shared),
        title="Elections over time",
        reading="All strips share one time axis: from a mark in the top row (an epoch with none or"
        " several boards enabled) look down to the errors w that were compared, to the rounds that"
        " agreement took, to the links that were silent, and to what was done to them.",
        wide=True,
    )
    without = remarks(runs, [run for run in runs if run.epochs is None], NOBODY_ELECTED)
    return Section("elections", "Elections", [*over_time, *without])


def one_epoch(runs: Sequence[ReportedRun], pictures: Pictures, number: int | None) -> Section:
    """One epoch as a space-time diagram: the one asked for, else one that lost a frame."""
    ticking = [run for run in runs if not run.in_realtime]
    scenes = {run.number: scene for run in ticking if (scene := _scene(run, number)) is not None}
    drawn = pictures.each(
        "epoch",
        [run for run in runs if run.number in scenes],
        lambda run: spacetime(scenes[run.number]),
        title="One epoch, frame by frame",
        reading="Boards are lines, ticks go from left to right, and an arrow is a frame from the"
        " tick it was said in to the tick it was heard in; a dot has the colour of the board whose"
        " w is the largest that is known there, so agreement is a column of one colour.",
        wide=True,
    )
    return Section(
        "epoch",
        "A round of max-consensus",
        [
            *drawn,
            *remarks(runs, [run for run in ticking if run.epochs is None], NOBODY_ELECTED),
            *remarks(runs, [run for run in runs if run.in_realtime], NO_BARRIER),
            *remarks(
                runs,
                [run for run in ticking if run.epochs is not None and run.number not in scenes],
                "It ended before the last round of its first epoch.",
            ),
        ],
    )


def _scene(run: ReportedRun, number: int | None) -> Scene | None:
    epochs = run.epochs
    if epochs is None or not len(epochs.number):
        return None
    if number is None:
        return Scene(run.recording, epochs, telling_epoch(run.recording, epochs))
    found = np.flatnonzero(epochs.number == number)
    if not len(found):
        known = f"{epochs.number[0]} to {epochs.number[-1]}"
        line = f"{run.label} has no epoch {number}; it has {known}"
        raise FailedError(ExitCode.BAD_INPUT, line)
    return Scene(run.recording, epochs, int(found[0]))


def happenings(runs: Sequence[ReportedRun]) -> Section:
    """Every fault and command, in words."""
    blocks: list[Block] = []
    for run in runs:
        tick_s = run.recording.trajectory.tick_s
        rows = [[f"{tick * tick_s:.3f}", f"{tick:,}", words] for tick, words in run.told]
        if rows:
            blocks.append(
                PageTable(
                    titled("What happened", run, runs),
                    "Commands, boards that came, went and failed, and verdicts of the plant, each"
                    " with the tick from which it holds; the timeline under the elections draws"
                    " them.",
                    ["time (s)", "tick", "what"],
                    rows,
                    texts=frozenset({2}),
                    folded=len(rows) > FOLDED_FROM,
                )
            )
    quiet = "Nothing was done to the robot, and no board came, went or failed."
    blocks += remarks(runs, [run for run in runs if not run.told], quiet)
    return Section("happenings", "Faults and commands", blocks)
