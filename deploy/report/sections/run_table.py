"""Tables with a few rows for each run, and how spreads and gaps are written in them."""

from collections.abc import Sequence

from deploy.recording.latency import Distribution, spread
from deploy.recording.trajectory import Floats
from deploy.report.page import PageTable
from deploy.report.runs import ReportedRun

NONE = "-"
SPREAD_HEADER = ["known", "p50", "p90", "p99", "max"]
NS_PER_MS = 1e6
NO_WALL_TIME = "A twin has no wall time: its boards and its plant take turns in one process."
NO_BARRIER = "In realtime nobody waits for a frame or a tick: see Realtime for the times."

Row = tuple[ReportedRun, Sequence[str]]


def run_table(
    runs: Sequence[ReportedRun],
    title: str,
    reading: str,
    header: Sequence[str],
    rows: Sequence[Row],
    *,
    last_is_text: bool = False,
    notes: Sequence[tuple[str, str]] = (),
) -> PageTable:
    """Make a table whose first column names the run, where the report is of several."""
    several = len(runs) > 1
    texts = {*range(1 + several), *([len(header) - 1 + several] if last_is_text else [])}
    return PageTable(
        title,
        reading,
        [*["run"] * several, *header],
        [[*[run.label] * several, *cells] for run, cells in rows],
        notes=notes,
        texts=frozenset(texts),
    )


def spread_cells(values: Floats, digits: str) -> list[str]:
    """Write how values lie, below `SPREAD_HEADER`."""
    found: Distribution | None = spread(values)
    if found is None:
        return ["0", *[NONE] * 4]
    return [f"{found.known:,}", *(format(value, digits) for value in found[1:])]
