"""What was measured of T_e, as a table for a terminal: at most 80 columns."""

from collections.abc import Iterator, Sequence

from rich import box
from rich.table import Table

from deploy.experiments.election_period.run import PeriodResult
from plant_server.session.record import FELL

WITHOUT = "none"
"""In place of T_e: no elections."""
_INDICES = {
    "overshoot_deg": ("over\n°", 2),
    "rise_s": ("rise\ns", 2),
    "settling_band_s": ("in 2 %\ns", 2),
}


def te_table(results: Sequence[PeriodResult]) -> Table:
    """Overshoot, rise and settling of each variable, and positive energy, over T_e."""
    names = list(results[0].summary["indices"])
    table = Table(
        box=box.SIMPLE_HEAD,
        title="Table II over the election period",
        title_style="bold",
        title_justify="left",
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    headings = [f"{name}\n{heading}" for name in names for heading, _ in _INDICES.values()]
    for heading in ("T_e\ns", *headings, "energy\n+, J", ""):
        table.add_column(heading, justify="right", no_wrap=True)
    for result in results:
        table.add_row(*_cells(result, names), end_section=result.period_s is None)
    return table


def _cells(result: PeriodResult, names: Sequence[str]) -> Iterator[str]:
    summary = result.summary
    fell = summary["ending"] == FELL
    yield WITHOUT if result.period_s is None else f"{result.period_s:g}"
    for name in names:
        for key, (_, decimals) in _INDICES.items():
            value = summary["indices"][name][key]
            yield "-" if fell or value is None else f"{value:.{decimals}f}"
    yield "-" if fell else f"{summary['energy_j']['positive']:.2f}"
    yield FELL if fell else ""
