"""The figure of consensus: rounds to agreement, several enabled, and wall time, over the boards.

Rule: as in `deploy.outcome.figures`, the same results give the same file, byte for byte.
"""

from collections.abc import Sequence
from math import nan
from pathlib import Path
from typing import Any

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import (
    FixedLocator,
    FuncFormatter,
    LogLocator,
    NullLocator,
    PercentFormatter,
)

from deploy.experiments.consensus.run import ConsensusRow, Quantiles
from deploy.outcome.drawing import INK, PALE, series_look
from deploy.outcome.figures import DOTS_PER_INCH, FORMATS, STYLE, WIDTH_IN

ROW_IN, ABOVE_IN, BELOW_IN = 1.55, 0.52, 0.4
ENDINGS = ("svg", "png")
ASIDE = 0.04
"""Lines are moved apart by such a share of the boards, where they would hide each other."""
TICKS_MAX = 7
WIDE = 300.0
"""From here on an axis has a tick for each power of ten only."""
DIAMETER: dict[str, Any] = {"color": PALE, "linewidth": 3.0, "zorder": 0}
LABELS = ("Rounds to agreement", "Several enabled after R", "Wall time to agreement (ms)")


def consensus_figure(rows: Sequence[ConsensusRow], stem: Path) -> list[Path]:
    """Draw a column of panels for each graph; return the files written. Raises OSError."""
    graphs = list(dict.fromkeys(row.graph for row in rows))
    losses = sorted({row.loss for row in rows})
    drawn = [draw_rounds, draw_several]
    if any(row.wall_ms.p50 is not None for row in rows):
        drawn.append(draw_wall)
    height_in = ABOVE_IN + ROW_IN * len(drawn) + BELOW_IN
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DOTS_PER_INCH)
        figure.subplots_adjust(
            left=0.075,
            right=0.99,
            bottom=BELOW_IN / height_in,
            top=1.0 - ABOVE_IN / height_in,
            wspace=0.08,
            hspace=0.14,
        )
        panels = figure.subplots(len(drawn), len(graphs), sharex=True, sharey="row", squeeze=False)
        for graph, column in zip(graphs, panels.T, strict=True):
            for axes, draw in zip(column, drawn, strict=True):
                for order, loss in enumerate(losses):
                    line = sorted(row for row in rows if (row.graph, row.loss) == (graph, loss))
                    draw(axes, line, order, aside=1.0 + ASIDE * (order - (len(losses) - 1) / 2))
            column[0].set_title(graph.capitalize(), loc="left", weight="bold")
            column[-1].set_xlabel("Boards")
        _axes(panels, rows)
        figure.align_ylabels(panels[:, 0])
        _key(figure, losses)
        paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ENDINGS]
        for path, ending in zip(paths, ENDINGS, strict=True):
            figure.savefig(path, metadata=FORMATS[ending])
        return paths


def draw_rounds(axes: Axes, rows: Sequence[ConsensusRow], order: int, *, aside: float) -> None:
    """Draw after how many rounds all boards knew the maximum, for one loss."""
    at = [row.boards * aside for row in rows]
    _draw_spreads(axes, at, [row.agreement_rounds for row in rows], order)
    axes.plot([row.boards for row in rows], [row.diameter for row in rows], **DIAMETER)


def draw_several(axes: Axes, rows: Sequence[ConsensusRow], order: int, *, aside: float) -> None:
    """Draw after how many epochs more than one board would be enabled, for one loss."""
    at = [row.boards * aside for row in rows]
    axes.plot(at, [row.enabled_2_or_more / row.epochs for row in rows], **_look(order))


def draw_wall(axes: Axes, rows: Sequence[ConsensusRow], order: int, *, aside: float) -> None:
    """Draw how long it took until all boards knew the maximum, for one loss."""
    _draw_spreads(axes, [row.boards * aside for row in rows], [row.wall_ms for row in rows], order)


def _draw_spreads(
    axes: Axes, at: Sequence[float], spreads: Sequence[Quantiles], order: int
) -> None:
    """Draw a line through the medians, and from each up to its 99th percentile."""
    look = _look(order)
    axes.plot(at, [nan if spread.p50 is None else spread.p50 for spread in spreads], **look)
    for x, spread in zip(at, spreads, strict=True):
        if spread.p50 is not None and spread.p99 is not None:
            axes.plot((x, x), (spread.p50, spread.p99), color=look["color"], linewidth=0.8)


def _look(order: int) -> dict[str, Any]:
    return {**series_look(order), "linewidth": 0.9, "markersize": 2.8}


def _axes(panels: Any, rows: Sequence[ConsensusRow]) -> None:
    """Scale boards, rounds and time logarithmically, with plain numbers."""
    plain = FuncFormatter(lambda value, _place: f"{value:g}")
    for axes, label in zip(panels[:, 0], LABELS, strict=False):
        axes.set_ylabel(label)
        if label == LABELS[1]:
            axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
            axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])
            continue
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        few = high < WIDE * low
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        axes.yaxis.set_major_formatter(plain)
        axes.yaxis.set_minor_locator(NullLocator())
    boards = sorted({row.boards for row in rows})
    panels[0, 0].set_xscale("log")
    if len(boards) <= TICKS_MAX:
        panels[0, 0].xaxis.set_major_locator(FixedLocator(boards))
        panels[0, 0].xaxis.set_minor_locator(NullLocator())
    panels[0, 0].xaxis.set_major_formatter(plain)


def _key(figure: Figure, losses: Sequence[float]) -> None:
    """Say once, above the panels, what lines and bars are."""
    handles = [Line2D([], [], **_look(order)) for order in range(len(losses))]
    bar = Line2D([], [], color=INK, linewidth=0.8, marker="|", markersize=7.0, linestyle="none")
    figure.legend(
        [*handles, Line2D([], [], **DIAMETER), bar],
        [
            *(f"{loss:.0%} of frames lost" for loss in losses),
            "diameter",
            "up to the 99th percentile",
        ],
        loc="upper left",
        bbox_to_anchor=(0.065, 1.0),
        ncols=len(losses) + 2,
        columnspacing=1.6,
        handletextpad=0.5,
    )
