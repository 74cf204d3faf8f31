"""The figure of T_e: (A) overshoot, (B) rise, (C) settling and (D) energy over the election period.

Rule 1: as in `deploy.outcome.figures`, the same results give the same file, byte for byte.
Rule 2: what never happened has a place of its own, above all that did. A fall is a cross.
"""

from collections.abc import Callable, Sequence
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from deploy.experiments.election_period.run import PeriodResult
from deploy.outcome.drawing import INK, PALE, series_look
from deploy.outcome.figures import DOTS_PER_INCH, FORMATS, STYLE, WIDTH_IN
from deploy.outcome.summary import Summary
from plant_server.session.record import FELL

HEIGHT_IN = 4.0
ENDINGS = ("svg", "png")
INDICES = (
    ("A", "Overshoot (°)", "overshoot_deg", False),
    ("B", "Rise time: the reference is first reached (s)", "rise_s", True),
    ("C", "Settling time: within 2 % of the largest error (s)", "settling_band_s", False),
)
"""Letter, title, key in a summary, and whether to scale logarithmically."""
ENERGIES = {"positive": "positive", "absolute": "absolute", "|net|": "net"}
WITHOUT: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (5, 3)), "zorder": 1}
HAPPENED = 0.82
"""Share of a panel's height below the rows of what never happened."""
ROW = 0.055
LOG_LOW_S = 0.03
LOG_TICKS = [step * 10.0**decade for decade in range(-3, 4) for step in (1.0, 2.0, 5.0)]


class Line(NamedTuple):
    """One line of a panel."""

    label: str
    order: int
    """Which colour, style and marker."""
    reading: Callable[[Summary], float | None]


def te_figure(results: Sequence[PeriodResult], usual_s: float, stem: Path) -> list[Path]:
    """Draw all panels; return the files written. `usual_s` is the scenario's own T_e.

    Raises OSError.
    """
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DOTS_PER_INCH)
        figure.subplots_adjust(
            left=0.05, right=0.99, bottom=0.095, top=0.875, wspace=0.11, hspace=0.24
        )
        panels = figure.subplots(2, 2, sharex=True).ravel()
        names = list(results[0].summary["indices"])
        for axes, (letter, title, key, log) in zip(panels, INDICES, strict=False):
            axes.set_title(rf"$\bf{{{letter}}}$  {title}", loc="left")
            lines = [Line(name, i, _index(name, key)) for i, name in enumerate(names)]
            draw(axes, lines, results, log=log)
        panels[3].set_title(r"$\bf{D}$  Energy: work of all joints (J)", loc="left")
        energies = [
            Line(label, len(names) + i, _energy(key))
            for i, (label, key) in enumerate(ENERGIES.items())
        ]
        draw(panels[3], energies, results, log=False)
        panels[3].legend(loc="lower left", ncols=3, columnspacing=1.2)
        for axes in panels:
            _period_axis(axes, results, usual_s)
        _key(figure, panels[0], usual_s)
        paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ENDINGS]
        for path, ending in zip(paths, ENDINGS, strict=True):
            figure.savefig(path, metadata=FORMATS[ending])
        return paths


def draw(axes: Axes, lines: Sequence[Line], results: Sequence[PeriodResult], *, log: bool) -> None:
    """Draw lines over T_e, and what they are without elections as broken ones."""
    stood = [result for result in results if result.summary["ending"] != FELL]
    elected = [result for result in stood if result.period_s is not None]
    values = [line.reading(result.summary) for line in lines for result in stood]
    _scale(axes, [value for value in values if value is not None], log=log, never=None in values)
    for row, line in enumerate(lines):
        look = _look(line.order)
        for result in stood:
            value = line.reading(result.summary)
            if result.period_s is None and value is not None:
                axes.axhline(value, color=look["color"], **WITHOUT)
        found = {_at(result): line.reading(result.summary) for result in elected}
        known = [nan if value is None else value for value in found.values()]
        axes.plot(list(found), known, label=line.label, **look)
        never = [period_s for period_s, value in found.items() if value is None]
        place = [1.0 - (row + 0.4) * ROW] * len(never)
        hollow = {**look, "linestyle": "none", "markerfacecolor": "white"}
        axes.plot(never, place, transform=axes.get_xaxis_transform(), **hollow)
    fallen = [_at(result) for result in results if result.summary["ending"] == FELL]
    cross: dict[str, Any] = {
        "color": INK,
        "linestyle": "none",
        "marker": "x",
        "markersize": 5.0,
        "clip_on": False,
    }
    axes.plot(fallen, [0.0] * len(fallen), transform=axes.get_xaxis_transform(), **cross)


def _at(result: PeriodResult) -> float:
    """Where a run is along the axis; without elections, nowhere."""
    return nan if result.period_s is None else result.period_s


def _scale(axes: Axes, values: Sequence[float], *, log: bool, never: bool) -> None:
    """Make room for all values and, if some thing never happened, for that above them."""
    top, share = max(values, default=1.0), HAPPENED if never else 0.95
    if log:
        low = min([LOG_LOW_S, *values])
        axes.set_yscale("log")
        axes.set_yticks([tick for tick in LOG_TICKS if low <= tick <= top])
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
        axes.set_ylim(low, low * (top / low) ** (1.0 / share))
    else:
        ticks = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(0.0, top)
        axes.set_yticks([tick for tick in ticks if 0.0 <= tick <= top])
        axes.set_ylim(-0.04 * top, top / share)
    if never:
        height = (1.0 + HAPPENED) / 2.0
        axes.text(-0.01, height, "never", transform=axes.transAxes, ha="right", va="center")


def _index(name: str, key: str) -> Callable[[Summary], float | None]:
    return lambda summary: summary["indices"].get(name, {}).get(key)


def _energy(key: str) -> Callable[[Summary], float | None]:
    return lambda summary: abs(summary["energy_j"][key])


def _look(order: int) -> dict[str, Any]:
    sizes = {"linewidth": 0.9, "markersize": 2.8, "markeredgewidth": 0.7}
    return {**series_look(order), **sizes}


def _period_axis(axes: Axes, results: Sequence[PeriodResult], usual_s: float) -> None:
    """Scale T_e logarithmically, with plain numbers, and mark the one that is used elsewhere."""
    periods_s = [result.period_s for result in results if result.period_s is not None]
    low, high = min(periods_s, default=usual_s), max(periods_s, default=usual_s)
    axes.set_xscale("log")
    axes.set_xlim(low / 1.06, high * 1.06)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    if low <= usual_s <= high:
        axes.axvline(usual_s, color=PALE, linewidth=0.8, zorder=0)
    if axes.get_subplotspec().is_last_row():  # type: ignore[union-attr]
        axes.set_xlabel("Election period $T_e$ (s)")


def _key(figure: Figure, axes: Axes, usual_s: float) -> None:
    """Say once, above the panels, what lines and marks are."""
    handles, labels = axes.get_legend_handles_labels()
    grey: dict[str, Any] = {"color": INK, "linestyle": "none", "markersize": 3.4}
    marks = {
        "without elections": Line2D([], [], color=INK, **WITHOUT),
        f"$T_e$ = {usual_s:g} s": Line2D([], [], color=PALE, linewidth=0.8),
        "never": Line2D([], [], **grey, marker="o", markerfacecolor="white"),
        "fell": Line2D([], [], **grey, marker="x"),
    }
    figure.legend(
        [*handles, *marks.values()],
        [*labels, *marks],
        loc="upper left",
        bbox_to_anchor=(0.045, 1.0),
        ncols=len(labels) + len(marks),
        columnspacing=1.6,
        handletextpad=0.5,
    )
