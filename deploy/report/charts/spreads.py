"""Small charts of the report: how rounds, times and fates of frames are spread.

Rule 1: a chart is as wide as a telephone, and several of them stand beside each other elsewhere.
Rule 2: times are drawn on a logarithmic scale: what matters is in the tail. p50, p90 and p99 are
        lines with their names.
Rule 3: limits are given, so that charts of several runs compare.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, PowerNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator, PercentFormatter

from deploy.outcome.drawing import INK, PALE, board_colour
from deploy.outcome.figures import DOTS_PER_INCH
from deploy.recording.epochs import NOT_KNOWN, Epochs
from deploy.recording.frame_fate import FrameFate
from deploy.recording.latency import Distribution, spread
from deploy.recording.link_counts import FATES, LinkCounts
from deploy.recording.trajectory import Floats, Integers
from deploy.report.charts.strips import MISSED

WIDTH_IN, HEIGHT_IN = 3.5, 1.9
ROW_IN = 0.18
BINS = 60
ROUNDS_LARGE_MAX, ROUNDS_SHOWN_MAX = 12, 16
LEGEND_MAX, LEGEND_COLUMNS_MAX = 6, 4
DIGITS = {
    0.9: (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0),
    2.5: (1.0, 2.0, 5.0),
    np.inf: (1.0,),
}
"""Numbers on a logarithmic scale of at most so many decades: two to eight have room."""
FEW_SHOW = 0.4
"""Exponent of the scale of shares over time."""
DARK = 0.5
"""Of the largest share, from which numbers are white."""
SHARES = LinearSegmentedColormap.from_list("shares", ["#ffffff", "#dbe3e8", "#7f97a6", "#2b4352"])
FATE_LOOKS: dict[FrameFate, dict[str, Any]] = {
    FrameFate.HEARD: {"color": "#d9dfe3"},
    FrameFate.LATE: {"color": "#ddcc77"},
    FrameFate.LOST: {"color": "#882255"},
    FrameFate.CORRUPT: {"color": "#999933"},
    FrameFate.CUT: {"color": "#222222"},
    FrameFate.NOBODY: {"facecolor": "white", "edgecolor": "0.55", "hatch": "/////"},
    FrameFate.VOID: {"facecolor": "white", "edgecolor": "0.55", "hatch": "....."},
    FrameFate.PENDING: {"color": "0.7"},
}


class Group(NamedTuple):
    """Values that are drawn in one colour, in milliseconds or NaN."""

    label: str
    """Empty: it needs none, as there is no other."""
    colour: Any
    values_ms: Floats


def log_limits(values_ms: Sequence[Floats]) -> tuple[float, float] | None:
    """Limits of a logarithmic scale that holds all positive values; None if there are none."""
    every = (
        np.concatenate([np.ravel(values) for values in values_ms]) if values_ms else np.array([])
    )
    known = every[np.isfinite(every) & (every > 0.0)]
    return (0.8 * float(known.min()), 1.25 * float(known.max())) if len(known) else None


def histogram(groups: Sequence[Group], limits_ms: tuple[float, float], label: str) -> Figure:
    """Draw how often which time was taken, groups on top of each other, with percentiles."""
    figure, axes = _figure(HEIGHT_IN, left_in=0.5, top_in=0.34)
    edges, values = _binned(groups, limits_ms)
    colours = [group.colour for group in groups]
    labels = [group.label for group in groups]
    axes.hist(values, bins=edges.tolist(), stacked=True, color=colours, label=labels, linewidth=0)
    _explain_times(axes, values, limits_ms, label)
    return figure


def tails(groups: Sequence[Group], limits_ms: tuple[float, float], label: str) -> Figure:
    """Draw how often which time was taken, a line for each group, so that what is rare shows."""
    figure, axes = _figure(HEIGHT_IN, left_in=0.5, top_in=0.34)
    edges, values = _binned(groups, limits_ms)
    for group, own in zip(groups, values, strict=True):
        counts, _edges = np.histogram(own, edges)
        axes.stairs(counts, edges, color=group.colour, label=group.label, linewidth=0.9)
    _explain_times(axes, values, limits_ms, label)
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.7)
    axes.yaxis.set_minor_locator(NullLocator())
    return figure


def _binned(groups: Sequence[Group], limits_ms: tuple[float, float]) -> tuple[Floats, list[Floats]]:
    """Edges of the bins of a logarithmic scale, and the values of each group that are numbers."""
    values = [group.values_ms[np.isfinite(group.values_ms)] for group in groups]
    return np.geomspace(*limits_ms, BINS + 1), values


def _explain_times(
    axes: Axes, values: Sequence[Floats], limits_ms: tuple[float, float], label: str
) -> None:
    """Add legend, percentiles, scale and names to how often which time was taken."""
    if 1 < len(values) <= LEGEND_MAX:
        axes.legend(loc="best", handlelength=0.8, frameon=True, framealpha=0.8, edgecolor="none")
    found = spread(np.concatenate(values))
    assert found is not None, "limits come from values, so there are some"
    _mark_percentiles(axes, found)
    _log_ms(axes, limits_ms)
    axes.set(xlabel=label, ylabel="How often")


def over_time(share: Floats, bin_s: float, end_s: float, names: Sequence[str]) -> Figure:
    """Draw shares over time, a row for each name: white none, black all; (names, bins).

    A small share is darker than its part of black, or one in a hundred would not be seen.
    """
    figure, axes = _figure(0.5 + ROW_IN * len(names), left_in=0.62, top_in=0.06)
    axes.imshow(
        np.ma.masked_invalid(share),
        aspect="auto",
        interpolation="nearest",
        origin="lower",
        cmap=MISSED,
        norm=PowerNorm(FEW_SHOW, 0.0, 1.0),
        extent=(0.0, share.shape[1] * bin_s, -0.5, len(names) - 0.5),
    )
    axes.set_xlim(0.0, end_s)
    _plain_rows(axes, names)
    axes.set_xlabel("Time (s)")
    return figure


def _mark_percentiles(axes: Axes, found: Distribution) -> None:
    """Lines from low to high, named above; names that would touch go higher."""
    for row, (name, value) in enumerate(zip(("p50", "p90", "p99", "max"), found[1:], strict=True)):
        axes.axvline(value, color=INK, linewidth=0.7, linestyle=(0, (3, 2)))
        axes.annotate(
            name,
            (value, 1.0),
            (0.0, 2.0 + 6.5 * (row % 2)),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            size=6.0,
            ha="center",
            color=INK,
        )


def rounds_matrix(epochs: Epochs, joints: Sequence[str], rounds: int) -> Figure:
    """Draw after how many rounds each board knew the maximum: a row per board, shaded by share."""
    columns = [*range(rounds + 1), NOT_KNOWN]
    known = [epochs.known_after[epochs.members[:, board], board] for board in range(len(joints))]
    counted = np.array([[int((of == column).sum()) for column in columns] for of in known])
    share = counted / np.maximum(counted.sum(axis=1, keepdims=True), 1)
    figure, axes = _figure(0.62 + ROW_IN * len(joints), left_in=0.62, top_in=0.08)
    axes.imshow(share, aspect="auto", origin="lower", cmap=SHARES, vmin=0.0)
    size = 6.0 if len(columns) <= ROUNDS_LARGE_MAX else 4.8
    for row, column in np.argwhere(counted > 0) if len(columns) <= ROUNDS_SHOWN_MAX else ():
        colour = "white" if share[row, column] > DARK * share.max() else INK
        number = f"{counted[row, column]}"
        axes.text(column, row, number, size=size, ha="center", va="center", color=colour)
    step = 1 + rounds // ROUNDS_LARGE_MAX
    shown = list(range(0, rounds + (step == 1), step))
    axes.set_xticks([*shown, rounds + 1], [*map(str, shown), "never"])
    _plain_rows(axes, joints)
    axes.set_xlabel("Rounds until it knew the maximum (epochs)")
    return figure


def ranges(
    rows: Sequence[tuple[str, Distribution]], limits_ms: tuple[float, float], label: str
) -> Figure:
    """Draw a row for each spread: a line from p50 to the most, with dots at the percentiles."""
    figure, axes = _figure(0.72 + ROW_IN * len(rows), left_in=0.95, top_in=0.26)
    for row, (_name, found) in enumerate(rows):
        axes.plot([found.p50, found.most], [row, row], color="0.7", linewidth=0.8, zorder=1)
    for name, marker, face in (("p50", "o", INK), ("p90", "s", "0.55"), ("p99", "D", "white")):
        values = [getattr(found, name) for _name, found in rows]
        axes.plot(
            values, range(len(rows)), marker, markersize=3.4, markeredgecolor=INK,
            markerfacecolor=face, markeredgewidth=0.6, linestyle="none", label=name,
        )  # fmt: skip
    most = [found.most for _name, found in rows]
    axes.plot(most, range(len(rows)), "|", color=INK, markersize=5.0, label="max")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.0,
        handletextpad=0.2, columnspacing=1.0, handlelength=1.0,
    )  # fmt: skip
    _log_ms(axes, limits_ms)
    _plain_rows(axes, [name for name, _found in rows])
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.set_xlabel(label)
    return figure


def fates(links: Sequence[LinkCounts], joints: Sequence[str]) -> Figure:
    """Draw what became of the frames of each directed link, as shares of those sent."""
    used = [fate for fate in FATES if any(link.fates[fate] for link in links)]
    columns = len(used) if len(used) <= LEGEND_COLUMNS_MAX else (len(used) + 1) // 2
    legend_in = 0.16 * -(-len(used) // max(columns, 1))
    figure, axes = _figure(0.5 + legend_in + ROW_IN * len(links), left_in=0.95, top_in=legend_in)
    left = np.zeros(len(links))
    for fate in used:
        share = np.array([link.fates[fate] / max(link.sent, 1) for link in links])
        name, look = fate.name.lower(), FATE_LOOKS[fate]
        axes.barh(range(len(links)), share, 0.74, left, label=name, linewidth=0.0, **look)
        left += share
    axes.set_xlim(0.0, 1.0)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    _plain_rows(axes, [f"{joints[link.sender]} → {joints[link.receiver]}" for link in links])
    axes.legend(
        loc="lower left", bbox_to_anchor=(-0.38, 1.0), ncols=max(columns, 1), borderaxespad=0.0,
        handlelength=1.0, handletextpad=0.4, columnspacing=1.0,
    )  # fmt: skip
    axes.set_xlabel("Frames sent")
    return figure


def waited_for(last: Integers, joints: Sequence[str]) -> Figure:
    """Draw in which share of the ticks each board was the last to answer."""
    figure, axes = _figure(0.5 + ROW_IN * len(joints), left_in=0.62, top_in=0.06)
    share = last / max(int(last.sum()), 1)
    colours = [board_colour(board, len(joints)) for board in range(len(joints))]
    axes.barh(range(len(joints)), share, 0.74, color=colours, linewidth=0.0)
    _plain_rows(axes, joints)
    axes.set_xlim(0.0, max(1.05 * float(share.max()), 0.05))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_xlabel("Ticks in which it answered last")
    return figure


def _figure(height_in: float, *, left_in: float, top_in: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DOTS_PER_INCH)
    bottom_in, right_in = 0.4, 0.16
    width = (WIDTH_IN - left_in - right_in) / WIDTH_IN
    height = (height_in - bottom_in - top_in) / height_in
    return figure, figure.add_axes((left_in / WIDTH_IN, bottom_in / height_in, width, height))


def _plain_rows(axes: Axes, names: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", length=0.0, labelsize=6.0)
    axes.spines["left"].set_visible(False)


def _log_ms(axes: Axes, limits_ms: tuple[float, float]) -> None:
    """A logarithmic scale with as many round numbers as have room."""
    axes.set_xscale("log")
    axes.set_xlim(limits_ms)
    decades = np.log10(limits_ms[1] / limits_ms[0])
    digits = next(digits for most, digits in DIGITS.items() if decades <= most)
    powers = 10.0 ** np.arange(np.floor(np.log10(limits_ms[0])), np.ceil(np.log10(limits_ms[1])))
    ticks = [digit * power for power in powers for digit in digits]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:g}"))
