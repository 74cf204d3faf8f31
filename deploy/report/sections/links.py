"""What became of the frames of a run, link by link, and how long they were on their way."""

from collections.abc import Sequence

import numpy as np

from deploy.recording.frame_fate import FrameFate
from deploy.recording.latency import Distribution, spread, ways_ns
from deploy.recording.link_counts import FATES
from deploy.recording.trajectory import Floats
from deploy.report.charts import spreads as charts
from deploy.report.charts.spreads import log_limits
from deploy.report.page import Block, Figure, PageTable, Section
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

MEANINGS = {
    FrameFate.HEARD: "used in the tick after it was said",
    FrameFate.LATE: "used later",
    FrameFate.LOST: "dropped by a fault of the link",
    FrameFate.CORRUPT: "a bit was flipped on the way, and the receiver refused it",
    FrameFate.CUT: "the link was cut",
    FrameFate.NOBODY: "there was no board at the other end, or a new one",
    FrameFate.VOID: "its sender died in that tick or right after it, or its receiver was told to go"
    " on without it",
    FrameFate.PENDING: "the recording ends before it was due",
}
ALWAYS_COUNTED = {FrameFate.HEARD, FrameFate.LATE, FrameFate.LOST}
"""Also where no frame has come to that."""
NO_SHARED_CLOCK = (
    "No one-way times: the processes do not read one clock, as far as they say, so what a frame"
    " took from one to another cannot be told from their stamps."
)
NOT_TIMED = "No one-way times: the boards told the plant of none."


def traffic(runs: Sequence[ReportedRun], pictures: Pictures) -> Section:
    """Fates and one-way times, as figures and as numbers; or why there are none."""
    linked = [run for run in runs if any(link.sent for link in run.links)]
    ways = {run.number: found for run in linked if (found := _ways_ms(run))}
    blocks: list[Block] = [
        *pictures.each(
            "fates",
            linked,
            lambda run: charts.fates(run.links, run.joints),
            title="What became of the frames",
            reading="A bar is all frames that one board sent to another, divided by what became of"
            " them; a frame is heard when it is used in the tick after it was said.",
        ),
        *_way_figures(linked, ways, pictures),
    ]
    if linked:
        blocks += [_links_table(runs, linked), *_refused_table(runs)]
    if ways:
        blocks.append(_ways_table(runs, ways))
    blocks += remarks(runs, [run for run in runs if run.in_realtime], NO_BARRIER)
    alone = [run for run in runs if not run.links and not run.in_realtime]
    blocks += remarks(runs, alone, "One board has no links.")
    quiet = [run for run in runs if run.links and run not in linked]
    blocks += remarks(runs, quiet, "It ended before the first frame.")
    silent = [run for run in linked if run.number not in ways]
    for why in (NO_WALL_TIME, NO_SHARED_CLOCK, NOT_TIMED):
        blocks += remarks(runs, [run for run in silent if _why_untimed(run) == why], why)
    return Section("links", "Links", blocks)


def _ways_ms(run: ReportedRun) -> list[tuple[str, Floats]]:
    """One-way times of each link that has any."""
    if not run.recording.clocks_shared:
        return []
    found = [
        (run.link_name(*pair), ways_ns(link) / NS_PER_MS)
        for pair, link in sorted(run.recording.links.items())
    ]
    return [(name, ways_ms) for name, ways_ms in found if np.isfinite(ways_ms).any()]


def _why_untimed(run: ReportedRun) -> str:
    if not run.timed:
        return NO_WALL_TIME
    return NOT_TIMED if run.recording.clocks_shared else NO_SHARED_CLOCK


def _way_figures(
    runs: Sequence[ReportedRun], ways: dict[int, list[tuple[str, Floats]]], pictures: Pictures
) -> list[Figure]:
    rows: dict[int, list[tuple[str, Distribution]]] = {
        number: [(name, times) for name, of in found if (times := spread(of)) is not None]
        for number, found in ways.items()
    }
    ends = [np.array([(of.p50, of.most) for _, of in found]) for found in rows.values()]
    shared = log_limits(ends)
    if shared is None:
        return []
    return pictures.each(
        "ways",
        [run for run in runs if run.number in rows],
        lambda run: charts.ranges(rows[run.number], shared, "One way (ms, logarithmic)"),
        title="How long frames were on their way",
        reading="A row is a directed link; its marks say within which time half, 90 % and 99 % of"
        " the frames were there, from when the sender began to speak until they came in.",
    )


def _links_table(runs: Sequence[ReportedRun], linked: Sequence[ReportedRun]) -> PageTable:
    found = {fate for run in linked for link in run.links for fate in FATES if link.fates[fate]}
    used = [fate for fate in FATES if fate in found | ALWAYS_COUNTED]
    rows = [
        (
            run,
            [
                run.link_name(link.sender, link.receiver),
                f"{link.sent:,}",
                *(f"{link.fates[fate]:,}" for fate in used),
                f"{link.bytes_sent:,}",
                _reasons(link.refused),
            ],
        )
        for run in linked
        for link in run.links
    ]
    return run_table(
        runs,
        "Frames of each directed link",
        "Each frame sent has one fate, so those columns add up to sent; refused, by reason, are"
        " frames that the receiver checked and did not take, warm-up included.",
        ["link", "sent", *(fate.name.lower() for fate in used), "bytes", "refused"],
        rows,
        last_is_text=True,
        notes=[(fate.name.lower(), MEANINGS[fate]) for fate in used],
    )


def _refused_table(runs: Sequence[ReportedRun]) -> list[PageTable]:
    """What boards refused though no link model had touched it: trouble of the real network."""
    rows = [
        (run, [joint, _reasons(refused)])
        for run in runs
        for joint, refused in zip(run.joints, run.recording.refused_by_network, strict=True)
        if any(refused.values())
    ]
    if not rows:
        return []
    reading = (
        "Frames that no fault of the scenario explains, by the reason why the board refused them:"
        " strangers on the network, or real trouble."
    )
    header = ["board", "refused"]
    return [run_table(runs, "Refused from the network", reading, header, rows, last_is_text=True)]


def _ways_table(
    runs: Sequence[ReportedRun], ways: dict[int, list[tuple[str, Floats]]]
) -> PageTable:
    rows = [
        (run, [name, *spread_cells(ways_ms, ".3f")])
        for run in runs
        for name, ways_ms in ways.get(run.number, [])
    ]
    return run_table(
        runs,
        "One way, in ms",
        "The same times as numbers; known: how many frames were timed.",
        ["link", *SPREAD_HEADER],
        rows,
    )


def _reasons(refused: dict[str, int]) -> str:
    told = [f"{reason} {number:,}" for reason, number in refused.items() if number]
    return ", ".join(told) or NONE
