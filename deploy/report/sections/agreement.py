"""How long the boards of a run took to agree and to decide: in ticks, and on the wall."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from deploy.outcome.drawing import board_colour
from deploy.recording.epochs import NOT_KNOWN
from deploy.recording.latency import decisions_ns
from deploy.recording.trajectory import Floats
from deploy.report.charts import spreads as charts
from deploy.report.charts.spreads import Group, log_limits
from deploy.report.page import Block, Figure, PageTable, Section
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun, remarks
from deploy.report.sections.run_table import (
    NO_BARRIER,
    NO_WALL_TIME,
    NS_PER_MS,
    SPREAD_HEADER,
    run_table,
    spread_cells,
)


def agreement(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """Rounds and times, as figures and as numbers; or why there are none."""
    ticking = [run for run in runs if not run.in_realtime]
    electing = [run for run in ticking if run.epochs is not None and len(run.epochs.number)]
    timed = [run for run in electing if run.timed]
    blocks: list[Block] = [
        *pictures.each(
            "rounds",
            electing,
            _rounds_matrix,
            title="Rounds until each board knew the maximum",
            reading="A row is a board, a column the round (one each tick) after which it knew the"
            " largest w, and the darker a cell the more epochs: the farther a board is from the"
            " winner, the farther to the right it is.",
        ),
        *_decision_figures(timed, pictures),
    ]
    if electing:
        blocks.append(_ticks_table(runs, electing))
    if timed:
        blocks.append(_decision_table(runs, timed))
    blocks += remarks(runs, [run for run in electing if not run.timed], NO_WALL_TIME)
    silent = [run for run in ticking if run not in electing]
    blocks += remarks(runs, silent, "No epochs, so no agreement.")
    blocks += remarks(runs, [run for run in runs if run.in_realtime], NO_BARRIER)
    return Section("agreement", "Agreement", blocks)


def _rounds_matrix(run: ReportedRun) -> Drawing:
    assert run.epochs is not None
    rounds = run.recording.trajectory.scenario.election.rounds
    return charts.rounds_matrix(run.epochs, run.joints, rounds)


def _decision_figures(timed: Sequence[ReportedRun], pictures: Pictures) -> list[Figure]:
    taken_ms = {run.number: _decisions_ms(run) for run in timed}
    shared = log_limits(list(taken_ms.values()))
    if shared is None:
        return []

    def draw(run: ReportedRun) -> Drawing:
        boards = len(run.joints)
        groups = [
            Group(joint, board_colour(board, boards), taken_ms[run.number][:, board])
            for board, joint in enumerate(run.joints)
        ]
        return charts.histogram(groups, shared, "From the epoch's start to the decision (ms)")

    return pictures.each(
        "decisions",
        timed,
        draw,
        title="Wall time from an epoch's start to each board's decision",
        reading="How often (up) a decision took how long (right, logarithmic), one colour for each"
        " board; half of all lie left of p50, one in a hundred right of p99.",
    )


def _decisions_ms(run: ReportedRun) -> Floats:
    assert run.epochs is not None
    taken_ms: Floats = decisions_ns(run.recording, run.epochs) / NS_PER_MS
    return taken_ms


def _ticks_table(runs: Sequence[ReportedRun], electing: Sequence[ReportedRun]) -> PageTable:
    rows = []
    for run in electing:
        assert run.epochs is not None
        after_each = [
            (joint, run.epochs.known_after[run.epochs.members[:, board], board])
            for board, joint in enumerate(run.joints)
        ]
        for name, after in [*after_each, ("all boards", run.epochs.agreed_after)]:
            known = after[after != NOT_KNOWN].astype(np.float64)
            cells = [name, *spread_cells(known, "g"), str(len(after) - len(known))]
            rows.append((run, cells))
    return run_table(
        runs,
        "Ticks until the maximum was known",
        "Ticks from an epoch's start until a board, or all of them, knew the largest w (known: in"
        " so many epochs); the same in every run of this scenario and seed.",
        ["board", *SPREAD_HEADER, "never"],
        rows,
    )


def _decision_table(runs: Sequence[ReportedRun], timed: Sequence[ReportedRun]) -> PageTable:
    rows = []
    for run in timed:
        taken_ms = _decisions_ms(run)
        by_board = [(joint, taken_ms[:, board]) for board, joint in enumerate(run.joints)]
        for name, values in [*by_board, ("all boards", taken_ms)]:
            rows.append((run, [name, *spread_cells(values, ".3f")]))
    return run_table(
        runs,
        "Wall time from an epoch's start to the decision, in ms",
        "From the opening of the epoch's first tick until the board had thought the last round"
        " through; where clocks are not shared, until the plant had its answer.",
        ["board", *SPREAD_HEADER],
        rows,
    )
