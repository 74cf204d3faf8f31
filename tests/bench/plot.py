"""The picture of a run of the bench: what was measured of systems, growth and engines."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from tests.bench.results import GroupResult, Results

OURS, OTHERS = "#c1272d", "#3b6ea5"


def picture(results: Results, path: Path) -> None:
    """Draw the panels for which there are results."""
    drawn = [
        (draw, [results.groups[name] for name in names if name in results.groups])
        for draw, names in (
            (_systems, ("systems",)),
            (_growth, ("growth", "processes")),
            (_engines, ("plant",)),
        )
    ]
    drawn = [(draw, groups) for draw, groups in drawn if any(group.entries for group in groups)]
    if not drawn:
        return
    figure = Figure(figsize=(5.0 * len(drawn), 4.2), layout="constrained")
    panels = figure.subplots(1, len(drawn), squeeze=False)[0]
    for panel, letter, (draw, groups) in zip(panels, "ABC", drawn, strict=False):
        draw(panel, groups)
        panel.set_title(letter, loc="left", fontweight="bold")
        panel.grid(visible=True, which="major", linewidth=0.4)
    figure.savefig(path, dpi=150)


def _numbered(panel: Axes) -> None:
    """Make the scale logarithmic, with plain numbers that have room."""
    panel.set_xscale("log")
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_minor_locator(NullLocator())
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))


def _systems(panel: Axes, groups: list[GroupResult]) -> None:
    """A dot at the median tick and a line to the one in a hundred."""
    (group,) = groups
    entries = sorted(group.entries.items(), key=lambda item: -item[1].spread("p50_us").median)
    for row, (name, entry) in enumerate(entries):
        p50, p99 = (entry.spread(key).median for key in ("p50_us", "p99_us"))
        colour = _colour(name)
        panel.plot([p50, p99], [row, row], color=colour, linewidth=1.5)
        panel.plot([p50], [row], "o", color=colour, markersize=5)
    panel.set_yticks(range(len(entries)), [name for name, _ in entries], fontsize=8)
    _numbered(panel)
    panel.set_xlabel("p50 (dot) to p99 of a tick, µs")


def _growth(panel: Axes, groups: list[GroupResult]) -> None:
    """Cost of one board over how many there are."""
    for group, style in zip(groups, ("o-", "s--"), strict=False):
        boards = [int(name.split()[0]) for name in group.entries]
        costs = [entry.spread("us_per_board") for entry in group.entries.values()]
        middle = [cost.median for cost in costs]
        bars = [[m - c.low for m, c in zip(middle, costs, strict=True)]]
        bars.append([c.high - m for m, c in zip(middle, costs, strict=True)])
        where = "in one process" if "twin" in group.title else "a process each"
        panel.errorbar(boards, middle, yerr=bars, fmt=style, label=where, capsize=3)
    panel.set_xscale("log")
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("boards")
    panel.set_ylabel("per board and tick, µs")
    panel.legend(loc="upper right")


def _engines(panel: Axes, groups: list[GroupResult]) -> None:
    """The cost of a tick of the body."""
    (group,) = groups
    entries = sorted(group.entries.items(), key=lambda item: -item[1].spread("us_per_tick").median)
    costs = [entry.spread("us_per_tick").median for _, entry in entries]
    panel.barh(range(len(entries)), costs, color=[_colour(name) for name, _ in entries])
    panel.set_yticks(range(len(entries)), [name for name, _ in entries], fontsize=8)
    _numbered(panel)
    panel.set_xlabel("the body alone, µs per tick")


def _colour(name: str) -> str:
    return OURS if name.startswith("decmesh") else OTHERS
