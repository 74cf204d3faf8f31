"""How the boards of a run in realtime kept their time: deadlines, ages, elections."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing

from deploy.outcome.drawing import board_colour
from deploy.outcome.realtime_table import verdict
from deploy.recording.epochs import NOT_KNOWN
from deploy.recording.latency import Distribution, spread
from deploy.recording.realtime_times import OwnTimeBoardTimes, RealtimeTimes
from deploy.recording.trajectory import Floats
from deploy.report.charts import spreads as charts
from deploy.report.charts.spreads import Group, log_limits
from deploy.report.page import Block, Figure, PageTable, Remark, Section
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun, remarks
from deploy.report.sections.run_table import NONE, SPREAD_HEADER, run_table, spread_cells

POLICIES = {"skip": "left out", "catch-up": "made up for, up to 10 at a time"}
BIN_S = 0.1
"""Missed deadlines are counted in stretches of this length."""
Of = Callable[[OwnTimeBoardTimes], Floats]


def realtime(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """Everything about the runs in realtime."""
    kept = [run for run in runs if run.in_realtime]
    blocks: list[Block] = [
        *_verdicts(runs, kept),
        *_missed_figures(kept, pictures),
        *_histograms(
            "loop-periods",
            kept,
            pictures,
            lambda board: board.period_ms,
            label="From one turn of a loop to the next (ms)",
            title="Period of each board's loop",
            reading="How often (up, logarithmic) a period had which length (right, logarithmic): a"
            " loop that keeps its time is one peak at its period, and what lies to the right of it"
            " are turns that began late or were left out.",
        ),
        *_histograms(
            "computing",
            kept,
            pictures,
            lambda board: board.busy_ms,
            label="From waking up to the torque (ms)",
            title="Computing time of a turn",
            reading="How often (up, logarithmic) a turn took how long until its torque was on the"
            " way, interruptions included: what is longer than a period misses its deadline.",
        ),
        *_age_figures(kept, pictures),
        *_histograms(
            "realtime-decisions",
            [run for run in kept if run.epochs is not None],
            pictures,
            lambda board: board.decision_ms,
            label="From the epoch's start to the decision (ms)",
            title="Wall time from an epoch's start to each decision",
            reading="How often (up, logarithmic) a decision took how long, by the board's own"
            " reckoning of when the epoch began: R rounds, the wait for the board's next turn, and"
            " its computing.",
        ),
        _deadline_table(runs, kept),
        _loop_table(runs, kept),
        _age_table(runs, kept),
        *_election_tables(runs, kept),
    ]
    blocks += remarks(runs, [run for run in runs if not run.in_realtime], "It ran in lockstep.")
    return Section("realtime", "Realtime", blocks)


def _times(run: ReportedRun) -> RealtimeTimes:
    times = run.recording.realtime
    assert times is not None
    return times


def _boards(run: ReportedRun) -> Iterator[tuple[str, OwnTimeBoardTimes]]:
    return zip(run.joints, _times(run).boards, strict=True)


def _verdicts(runs: Sequence[ReportedRun], kept: Sequence[ReportedRun]) -> Iterator[Remark]:
    for run in kept:
        yield from remarks(runs, [run], verdict(run.summary["realtime"]))


def _missed_figures(kept: Sequence[ReportedRun], pictures: Pictures) -> list[Figure]:
    end_s = max(BIN_S, *(run.summary["simulated_s"] for run in kept))

    def draw(run: ReportedRun) -> Drawing:
        shares = [_missed_shares(board, run.summary["simulated_s"]) for _, board in _boards(run)]
        return charts.over_time(np.array(shares), BIN_S, end_s, run.joints)

    return pictures.each(
        "deadlines",
        kept,
        draw,
        title="Deadlines missed over time",
        reading="A row is a board, and the darker a stretch of 0.1 s the more of its deadlines were"
        " missed (white none, black all): dark in all rows at once is the host, in a single row it"
        " is that board.",
    )


def _missed_shares(board: OwnTimeBoardTimes, length_s: float) -> Floats:
    """Share of the deadlines missed in each stretch of `BIN_S`; NaN where the board had none."""
    bins = max(1, int(np.ceil(length_s / BIN_S - 1e-9)))
    where = np.minimum((board.due_s / BIN_S).astype(np.int64), bins - 1)
    periods = np.bincount(where, weights=1 + board.skipped, minlength=bins)
    missed = np.bincount(where, weights=board.late + board.skipped, minlength=bins)
    share: Floats = np.divide(missed, periods, out=np.full(bins, np.nan), where=periods > 0)
    return share


def _histograms(
    name: str,
    kept: Sequence[ReportedRun],
    pictures: Pictures,
    of: Of,
    *,
    label: str,
    title: str,
    reading: str,
) -> list[Figure]:
    """The same of every run, a line for each board."""
    shared = log_limits([of(board) for run in kept for _, board in _boards(run)])
    if shared is None:
        return []

    def draw(run: ReportedRun) -> Drawing:
        groups = [
            Group(joint, board_colour(number, len(run.joints)), of(board))
            for number, (joint, board) in enumerate(_boards(run))
        ]
        return charts.tails(groups, shared, label)

    return pictures.each(name, kept, draw, title=title, reading=reading)


def _ages(run: ReportedRun) -> Iterator[tuple[str, Floats]]:
    """Everything that has an age when it is used, by what and where."""
    for joint, board in _boards(run):
        yield f"{joint}: observation", board.observation_age_ms
        for other, ages_ms in board.neighbour_age_ms.items():
            yield f"{joint}: frame of {run.joints[other]}", ages_ms
    for joint, board in _boards(run):
        yield f"plant: torque of {joint}", board.torque_age_ms


def _age_figures(kept: Sequence[ReportedRun], pictures: Pictures) -> list[Figure]:
    rows: dict[int, list[tuple[str, Distribution]]] = {
        run.number: [(name, found) for name, of in _ages(run) if (found := spread(of)) is not None]
        for run in kept
    }
    every = [np.array(found[1:]) for of in rows.values() for _, found in of]
    shared = log_limits(every)
    if shared is None:
        return []
    return pictures.each(
        "ages",
        [run for run in kept if rows[run.number]],
        lambda run: charts.ranges(rows[run.number][::-1], shared, "Age when used (ms)"),
        title="How old what was used was",
        reading="A row is what somebody uses, from its median age to its largest: observations and"
        " frames at the beginning of a turn, torques at each tick; none can be younger than the"
        " network and the phases of the loops make it.",
    )


def _deadline_table(runs: Sequence[ReportedRun], kept: Sequence[ReportedRun]) -> PageTable:
    rows = []
    for run in kept:
        policy = POLICIES[_times(run).policy]
        for joint, board in _boards(run):
            late, skipped = int(board.late.sum()), int(board.skipped.sum())
            share = f"{100.0 * board.missed / board.periods:.2f} %" if board.periods else NONE
            counts = board.periods, len(board.late) - late, late, skipped
            cells = [joint, f"{board.rate_hz:g}", *(f"{count:,}" for count in counts), share]
            rows.append((run, [*cells, f"{board.torque_stale_ticks:,}", policy]))
    return run_table(
        runs,
        "Deadlines",
        "Each period of a loop is in time, late (its torque came after its end) or skipped, the"
        " latter two being missed; stale are ticks of the plant in which the torque was too old to"
        " be applied.",
        ["board", "Hz", "periods", "in time", "late", "skipped", "missed", "stale", "missed ones"],
        rows,
        last_is_text=True,
    )


def _loop_table(runs: Sequence[ReportedRun], kept: Sequence[ReportedRun]) -> PageTable:
    rows = []
    for run in kept:
        for joint, board in _boards(run):
            for name, values_ms in (
                ("period", board.period_ms),
                ("woke up late", board.wake_late_ms),
                ("computing", board.busy_ms),
            ):
                rows.append((run, [f"{joint}: {name}", *spread_cells(values_ms, ".3f")]))
    return run_table(
        runs,
        "The loops, in ms",
        "From one turn to the next; from when a turn was due until it began; and from then until"
        " its torque was on the way, interruptions included.",
        ["what", *SPREAD_HEADER],
        rows,
    )


def _age_table(runs: Sequence[ReportedRun], kept: Sequence[ReportedRun]) -> PageTable:
    rows = [
        (run, [name, *spread_cells(ages_ms, ".3f")]) for run in kept for name, ages_ms in _ages(run)
    ]
    return run_table(
        runs,
        "Age of what was used, in ms",
        "How long ago an observation had been taken and a neighbour's newest frame said when a"
        " turn began, and how long ago the torque in force had been said at each tick.",
        ["what", *SPREAD_HEADER],
        rows,
    )


def _election_tables(
    runs: Sequence[ReportedRun], kept: Sequence[ReportedRun]
) -> Iterator[PageTable]:
    rows = []
    for run in kept:
        epochs = run.epochs
        if epochs is None:
            continue
        for number, (joint, board) in enumerate(_boards(run)):
            decided = int(np.isfinite(board.decision_ms).sum())
            known = epochs.known_after[epochs.members[:, number], number]
            rounds = spread(known[known != NOT_KNOWN].astype(np.float64))
            after = NONE if rounds is None else f"{rounds.p50:g} / {rounds.most:g}"
            missed = f"{len(board.decision_ms) - decided:,}"
            cells = [joint, f"{decided:,}", missed, after]
            rows.append((run, [*cells, *spread_cells(board.decision_ms, ".3f")[1:]]))
    if rows:
        yield run_table(
            runs,
            "Elections, decisions in ms",
            "Epochs that a board decided and epochs whose last round it did not play; after how"
            " many rounds it knew the largest w (median / most); and how long after the epoch's"
            " start it decided.",
            ["board", "decided", "missed", "rounds", *SPREAD_HEADER[1:]],
            rows,
        )
