"""The figure of the loss study: (A) agreement and (B) balance over the loss of frames.

Rule: as in `deploy.outcome.figures`, the same results give the same file, byte for byte.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from deploy.experiments.consensus.theory import several_enabled
from deploy.experiments.loss import LOSSES, STANDING_FROM_S, Mean
from deploy.outcome.drawing import INK, series_look
from deploy.outcome.figures import DOTS_PER_INCH, FORMATS, STYLE, WIDTH_IN

HEIGHT_IN = 2.7
ENDINGS = ("svg", "png")
CLOSED_FORMS = (
    ("R = 2, ends: $1-p^2$", (0, (5, 3)), True),
    ("R = 2, middle: $1-(1-q^2)^2$", (0, (2, 1.5)), False),
)
"""Label, dashes, and whether maximum and runner-up sit at the two ends."""
STANDING = f"filled: from upright, {STANDING_FROM_S:g} s and later"
ASTRAY = "hollow: from the motion without loss"
ASIDE = 0.004
"""Lines are moved apart by so much loss, where they would hide each other's ranges."""


def loss_figure(rows: Sequence[Mean], stem: Path) -> list[Path]:
    """Draw both panels; return the files written. Raises OSError."""
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DOTS_PER_INCH)
        agreement, balance = figure.subplots(1, 2)
        figure.subplots_adjust(left=0.075, right=0.985, bottom=0.15, top=0.9, wspace=0.22)
        draw_agreement(agreement, rows)
        draw_balance(balance, rows)
        for axes in (agreement, balance):
            axes.set(xlabel="Frames lost on every link", xlim=(-0.015, LOSSES[-1] + 0.015))
            axes.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        paths = [stem.with_name(f"{stem.name}.{ending}") for ending in ENDINGS]
        for path, ending in zip(paths, ENDINGS, strict=True):
            figure.savefig(path, metadata=FORMATS[ending])
        return paths


def draw_agreement(axes: Axes, rows: Sequence[Mean]) -> None:
    """Draw how often more than one board was enabled, one line per R (A)."""
    loss = np.linspace(0.0, max(row.loss for row in rows), 101)
    for label, dashes, ends in CLOSED_FORMS:
        rate = several_enabled(loss, ends=ends)
        axes.plot(loss, rate, label=label, color=INK, linewidth=0.7, linestyle=dashes, zorder=1)
    for order, (rounds, line) in enumerate(_lines(rows)):
        x, y = [row.loss for row in line], [row.several_enabled for row in line]
        axes.plot(x, y, label=f"R = {rounds}", **_look(order))
    axes.set(ylabel="Epochs with several boards enabled", ylim=(-0.02, 0.82))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
    axes.set_title(r"$\bf{A}$  Agreement", loc="left")
    axes.legend(loc="upper left", borderaxespad=0.2)


def draw_balance(axes: Axes, rows: Sequence[Mean]) -> None:
    """Draw how far from upright the body stands, and how far its motion is astray (B)."""
    lines = _lines(rows)
    for order, (_rounds, line) in enumerate(lines):
        aside = ASIDE * (order - (len(lines) - 1) / 2)
        standing = {row.loss + aside: row.standing_deg for row in line if row.standing_deg}
        astray = {row.loss + aside: row.astray_deg for row in line}
        _draw_spreads(axes, standing, order, hollow=False)
        _draw_spreads(axes, astray, order, hollow=True)
        fallen = [row.loss + aside for row in line if row.fell]
        axes.plot(fallen, [0.0] * len(fallen), "x", color=_look(order)["color"], markersize=6.0)
    top = max(most for row in rows for most in (row.standing_deg or (0.1,))[-1:] + row.astray_deg)
    axes.set(ylabel="Farthest link, rms (°)", ylim=(-0.02 * top, 1.25 * top))
    for text, height in ((STANDING, 1.14), (ASTRAY, 0.8)):
        axes.text(0.0, height * top, text, color=INK, size=6.5, va="center")
    axes.set_title(r"$\bf{B}$  Balance", loc="left")


def _draw_spreads(
    axes: Axes, spreads: Mapping[float, tuple[float, float, float]], order: int, *, hollow: bool
) -> None:
    """Draw a line through the means, and from the least to the most of each."""
    look = _look(order, hollow=hollow)
    for x, (_mean, least, most) in spreads.items():
        axes.plot((x, x), (least, most), color=look["color"], linewidth=0.8)
    axes.plot(list(spreads), [mean for mean, _least, _most in spreads.values()], **look)


def _lines(rows: Sequence[Mean]) -> list[tuple[int, list[Mean]]]:
    """Rows of each R, by loss."""
    every = sorted({row.rounds for row in rows})
    return [(rounds, [row for row in rows if row.rounds == rounds]) for rounds in every]


def _look(order: int, *, hollow: bool = False) -> dict[str, Any]:
    look = series_look(order)
    face = "white" if hollow else look["color"]
    return {**look, "markersize": 3.4, "markerfacecolor": face, "markeredgewidth": 0.8}
