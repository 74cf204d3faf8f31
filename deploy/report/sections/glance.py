"""A run at a glance: one fact or outcome a row, so that runs can be held against each other."""

from collections.abc import Callable, Sequence

import numpy as np

from deploy.recording.epochs import NOT_KNOWN
from deploy.recording.frame_fate import FrameFate
from deploy.recording.latency import Distribution, decisions_ns, spread, ticks_ns
from deploy.recording.link_counts import MISSED, total
from deploy.report.page import PageTable, Section
from deploy.report.runs import ReportedRun
from deploy.report.sections.run_table import NONE

DIGITS = 12
"""Shown of a digest; `summary.json` has the whole."""


def glance(runs: Sequence[ReportedRun]) -> Section:
    """Facts and outcomes, one column for each run."""
    header = ["", *(run.label for run in runs)]
    facts = PageTable(
        "Facts and outcomes",
        "One row for each fact, one column for each run; equal digests of the motion mean equal"
        " motion to the last bit.",
        header,
        [[name, *map(tell, runs)] for name, tell in FACTS.items()],
        texts=frozenset(range(len(header))),
    )
    return Section("glance", "At a glance", [facts])


def _ended(run: ReportedRun) -> str:
    ending = str(run.summary["ending"])
    return ending if run.recording.complete else f"{ending} (recording incomplete)"


def _length(run: ReportedRun) -> str:
    return f"{run.summary['simulated_s']:g} s, {run.summary['ticks']:,} ticks"


def _speed(run: ReportedRun) -> str:
    per_s, wall_s = run.summary["ticks_per_s"], run.summary["wall_s"]
    return NONE if per_s is None else f"{wall_s:.1f} s, {per_s:,.0f} ticks/s"


def _seldom(run: ReportedRun, number: Callable[[ReportedRun], int]) -> str:
    if run.epochs is None:
        return NONE
    return f"{number(run)} of {len(run.epochs.number)}"


def _enabled(run: ReportedRun, least: int, most: int) -> int:
    assert run.epochs is not None
    boards = run.epochs.enabled_boards
    return int(((boards >= least) & (boards <= most)).sum())


def _never(run: ReportedRun) -> int:
    assert run.epochs is not None
    return int((run.epochs.agreed_after == NOT_KNOWN).sum())


def _rounds(run: ReportedRun) -> str:
    if run.epochs is None:
        return NONE
    agreed = run.epochs.agreed_after
    found = spread(agreed[agreed != NOT_KNOWN].astype(np.float64))
    return NONE if found is None else f"{found.p50:g} (p50), {found.most:g} (max)"


def _missed(run: ReportedRun) -> str:
    times = run.recording.realtime
    if times is None:
        return NONE
    missed = sum(board.missed for board in times.boards)
    periods = sum(board.periods for board in times.boards)
    return f"{missed:,} of {periods:,} ({100.0 * missed / max(periods, 1):.2f} %)"


def _tick(run: ReportedRun) -> str:
    return NONE if run.in_realtime else _ms(spread(ticks_ns(run.recording)))


def _decision(run: ReportedRun) -> str:
    times = run.recording.realtime
    if times is not None:
        return _ms(spread(np.concatenate([board.decision_ms for board in times.boards]) * 1e6))
    found = None if run.epochs is None else spread(decisions_ns(run.recording, run.epochs))
    return _ms(found)


def _ms(found: Distribution | None) -> str:
    if found is None:
        return NONE
    return f"{found.p50 / 1e6:.2f} ms (p50), {found.p99 / 1e6:.2f} ms (p99)"


def _frames(run: ReportedRun, *counted: FrameFate) -> str:
    sent, fates = total(run.links)
    if not sent:
        return NONE
    frames = sum(fates[fate] for fate in counted)
    return f"{frames:,} ({100.0 * frames / sent:.2f} %)"


def _versions(run: ReportedRun) -> str:
    return ", ".join(f"{name} {version or NONE}" for name, version in run.versions.items()) or NONE


FACTS: dict[str, Callable[[ReportedRun], str]] = {
    "scenario": lambda run: f"{run.summary['scenario']}, seed {run.summary['seed']}",
    "controller": lambda run: f"{run.summary['controller']}, in {run.mode}",
    "boards": lambda run: ", ".join(run.joints),
    "ended": _ended,
    "length": _length,
    "wall time": _speed,
    "energy, positive": lambda run: f"{run.summary['energy_j']['positive']:.2f} J",
    "rounds to agreement": _rounds,
    "epochs that never agreed": lambda run: _seldom(run, _never),
    "epochs with none enabled": lambda run: _seldom(run, lambda of: _enabled(of, 0, 0)),
    "epochs with several enabled": lambda run: _seldom(run, lambda of: _enabled(of, 2, 10**6)),
    "epoch start to decision": _decision,
    "frames sent": lambda run: NONE if run.in_realtime else f"{total(run.links)[0]:,}",
    "heard in the next tick": lambda run: _frames(run, FrameFate.HEARD),
    "heard late": lambda run: _frames(run, FrameFate.LATE),
    "lost on their way": lambda run: _frames(run, *MISSED),
    "tick": _tick,
    "deadlines missed": _missed,
    "digest of the motion": lambda run: run.summary["state_sha256"][:DIGITS],
    "digest of all logic": lambda run: run.recording.logical_sha256[:DIGITS],
    "started": lambda run: str(run.recording.facts.get("started", NONE)),
    "versions": _versions,
}
