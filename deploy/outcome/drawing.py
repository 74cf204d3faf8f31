"""How one panel of a figure is drawn, into axes that `deploy.outcome.figures` has placed.

Rule 1: limits are given (`Frame`), so that motions that are drawn beside each other compare.
Rule 2: a panel reads without colour: lines differ in style too, and time runs from light to dark.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import AsinhNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from deploy.outcome.indices import ABBREVIATIONS
from deploy.recording.trajectory import Floats, Trajectory

POSES = 12
FOOT_M = (-0.06, 0.18)
"""Heel and toe, forward of the ankle: a drawing, the model has no foot."""
LABELS_MAX, STRIP_LABELS_MAX = 6, 4
TIME_TICKS_S = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
"""On the scale of colours, beside both its ends."""

INK, PALE = "0.25", "0.8"
LINK_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Okabe and Ito: told apart by every common kind of colour vision."""
MARKERS = "osD^vP"
LINK_STYLES = ("-", (0, (4, 1.2)), (0, (6, 1, 1.2, 1)), (0, (1, 1)), (0, (8, 2)), (0, (2, 1)))
TIME_COLOURS = ListedColormap(mpl.colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)))


def series_look(order: int) -> dict[str, Any]:
    """How one of several lines of measured values is told from the others."""
    return {
        "color": LINK_COLOURS[order % len(LINK_COLOURS)],
        "linestyle": LINK_STYLES[order % len(LINK_STYLES)],
        "marker": MARKERS[order % len(MARKERS)],
    }


class Motion(NamedTuple):
    """A run as it is drawn, S samples of N links."""

    trajectory: Trajectory
    times_s: Floats
    orientations_deg: Floats
    """(S, N)."""
    com_m: Floats
    """(S, 2), forward and up from the ankle."""
    joints_m: Floats
    """(S, N + 1, 2): joints and, last, the tip."""


class Window(NamedTuple):
    """Limits of a panel with equal scales, in metres."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]


class Frame(NamedTuple):
    """What the panels of all motions in one figure have in common."""

    end_s: float
    orientations_deg: tuple[float, float]
    com: Window
    body: Window
    time_norm: AsinhNorm


def _title(axes: Axes, letter: str, text: str) -> None:
    axes.set_title(rf"$\bf{{{letter}}}$  {text}", loc="left")


def board_colour(link: int, links: int) -> Any:
    """The colour of a board, and of the link above its joint, in every figure."""
    if links <= len(LINK_COLOURS):
        return LINK_COLOURS[link]
    return mpl.colormaps["viridis"](0.9 * link / (links - 1))


def labelled_rows(links: int, most: int) -> list[int]:
    """Rows or links that get a label: all, or as many as can be read."""
    return sorted({round(i) for i in np.linspace(0, links - 1, min(links, most))})


def draw_orientations(axes: Axes, motion: Motion, frame: Frame) -> None:
    """Draw the links in space over time (A)."""
    names = motion.trajectory.scenario.link_names
    links, labelled = len(names), labelled_rows(len(names), LABELS_MAX)
    axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
    for link, name in enumerate(names):
        axes.plot(
            motion.times_s,
            motion.orientations_deg[:, link],
            color=board_colour(link, links),
            linestyle=LINK_STYLES[link % len(LINK_STYLES)] if links <= len(LINK_STYLES) else "-",
            label=ABBREVIATIONS.get(name, name) if link in labelled else None,
        )
    axes.set(xlim=(0.0, frame.end_s), ylim=frame.orientations_deg, ylabel="Orientation (°)")
    _title(axes, "A", "Links in space")
    if links <= len(ABBREVIATIONS):
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.005),
            ncols=links,
            borderaxespad=0.0,
            columnspacing=1.2,
            handletextpad=0.5,
        )
    else:
        axes.legend(loc="best", ncols=2, frameon=True, framealpha=0.85, edgecolor="none")


def draw_enabled(axes: Axes, motion: Motion, frame: Frame) -> None:
    """Draw one row per board, filled while it is enabled."""
    enabled, tick_s = motion.trajectory.enabled, motion.trajectory.tick_s
    joints = motion.trajectory.scenario.joints
    for board in range(len(joints)):
        bars = [(a * tick_s, (b - a) * tick_s) for a, b in spans(enabled[:, board] > 0)]
        colour = board_colour(board, len(joints))
        axes.broken_barh(bars, (board - 0.4, 0.8), facecolors=colour, linewidth=0)
    labelled = labelled_rows(len(joints), STRIP_LABELS_MAX)
    axes.set(xlim=(0.0, frame.end_s), ylim=(-0.6, len(joints) - 0.4))
    axes.set_yticks(labelled, [joints[board] for board in labelled])
    axes.tick_params(axis="y", length=0.0, labelsize=6.0)
    axes.set_ylabel("Enabled")
    axes.spines["left"].set_visible(False)


def spans(true: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Find where a condition holds, from each first to each last and one."""
    edges = np.flatnonzero(np.diff(true.astype(np.int8), prepend=0, append=0))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def draw_centre_of_mass(axes: Axes, motion: Motion, frame: Frame) -> None:
    """Draw the centre of mass in the sagittal plane, a dot each 10 ms (B)."""
    x_cm, y_cm = 100.0 * motion.com_m.T
    axes.scatter(
        x_cm, y_cm, c=motion.times_s, cmap=TIME_COLOURS, norm=frame.time_norm, s=3.5, linewidths=0
    )
    for sample, marker, label in ((0, "o", "start"), (-1, "s", "end")):
        axes.plot(
            x_cm[sample],
            y_cm[sample],
            marker=marker,
            color=INK,
            markerfacecolor="white",
            markersize=4.0,
            markeredgewidth=0.9,
            linestyle="none",
            label=label,
        )
    axes.set(
        xlim=[100.0 * x_m for x_m in frame.com.x_m],
        ylim=[100.0 * y_m for y_m in frame.com.y_m],
        xlabel="Forward (cm)",
        ylabel="Height (cm)",
    )
    axes.legend(loc="lower right", handletextpad=0.1, borderaxespad=0.0, handlelength=1.2)
    axes.xaxis.set_major_locator(MaxNLocator(4))
    _title(axes, "B", "Centre of mass")


def draw_poses(axes: Axes, motion: Motion, frame: Frame) -> None:
    """Draw the body at even distances along its way (C)."""
    axes.axhline(0.0, color=PALE, linewidth=0.6, zorder=0)
    axes.plot(FOOT_M, (0.0, 0.0), color=INK, linewidth=2.2, solid_capstyle="round", zorder=1)
    for order, sample in enumerate(evenly_apart(motion.joints_m)):
        x_m, y_m = motion.joints_m[sample].T
        colour = TIME_COLOURS(frame.time_norm(motion.times_s[sample]))
        axes.plot(
            x_m, y_m, color=colour, linewidth=1.0, marker="o", markersize=2.0, zorder=2 + order
        )
    axes.set(xlim=frame.body.x_m, ylim=frame.body.y_m, xlabel="Forward (m)", ylabel="Height (m)")
    axes.xaxis.set_major_locator(MaxNLocator(2))
    _title(axes, "C", "Body poses")


def evenly_apart(joints_m: Floats) -> list[int]:
    """Pick the first sample, the last, and more so that the body moves equally far between."""
    steps_m = np.linalg.norm(np.diff(joints_m, axis=0), axis=(1, 2))
    way_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    picked = np.searchsorted(way_m, np.linspace(0.0, way_m[-1], POSES))
    return sorted({0, *np.minimum(picked, len(way_m) - 1).tolist(), len(way_m) - 1})


def draw_time_scale(figure: Figure, axes: Axes, frame: Frame) -> None:
    """Draw the colours of time, for B and C."""
    bar = figure.colorbar(ScalarMappable(frame.time_norm, TIME_COLOURS), cax=axes)
    end_s = frame.end_s
    ticks_s = [0.0, *(tick_s for tick_s in TIME_TICKS_S if tick_s < 0.7 * end_s), end_s]
    bar.set_ticks(ticks_s, labels=[f"{tick_s:.3g}" for tick_s in ticks_s])
    bar.minorticks_off()
    bar.outline.set_visible(False)
    axes.tick_params(length=1.5)
    axes.set_title("t (s)", loc="left", size=6.5)
