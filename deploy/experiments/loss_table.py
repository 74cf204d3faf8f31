"""A study of loss as a table for a terminal."""

from collections.abc import Iterable, Iterator

from rich import box
from rich.table import Table

from deploy.experiments.loss import Mean


def loss_table(rows: Iterable[Mean]) -> Table:
    """The means for a terminal."""
    table = Table(
        box=box.SIMPLE_HEAD,
        title="Loss on every link",
        title_style="bold",
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    for heading in _HEADINGS:
        table.add_column(heading, justify="right", no_wrap=True)
    last = None
    for row in rows:
        if last not in (None, row.loss):
            table.add_section()
        table.add_row(*_cells(row, first=row.loss != last))
        last = row.loss
    return table


_HEADINGS = (
    "loss",
    "R",
    "several\nenabled",
    "agreed",
    "stand\nrms",
    "astray\nrms",
    "settled",
    "held",
    "extra-\npol.",
    "reck-\noned",
    "fell",
)


def _cells(row: Mean, *, first: bool) -> Iterator[str]:
    yield f"{row.loss:.0%}" if first else ""
    yield str(row.rounds)
    yield f"{row.several_enabled:.1%}"
    yield f"{row.agreed:.1%}"
    yield "-" if row.standing_deg is None else f"{row.standing_deg[0]:.3f}°"
    yield f"{row.astray_deg[0]:.3f}°"
    yield "never" if row.settling_band_s is None else f"{row.settling_band_s:.2f} s"
    yield f"{row.holding:.1%}"
    yield f"{row.extrapolating:.1%}"
    yield f"{row.reckoning:.1%}"
    yield f"{row.fell}/{row.runs}"
