"""The paper's figures of a run: (A) links in space, (B) centre of mass, (C) body poses.

Rule 1: nothing here decides what is true. Samples and geometry come from `deploy.outcome.indices`.
Rule 2: the same trajectory gives the same file, byte for byte: no dates, no random ids, only the
        fonts that come with matplotlib, no global state (pyplot).
Rule 3: a figure fits the page it is for, the text width of two columns.
Rule 4: this file says what a picture is made of, and where; `drawing` draws its panels.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.colors import AsinhNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from deploy.outcome import drawing
from deploy.outcome.drawing import FOOT_M, TIME_TICKS_S, Frame, Motion, Window
from deploy.outcome.indices import com_m, joint_positions_m, samples
from deploy.recording.trajectory import Floats, Trajectory

WIDTH_IN = 7.16
"""Text width of a two-column page."""
ROW_IN = 2.54
HEADING_IN = 0.2
BOTTOM_IN, PANEL_IN = 0.42, 1.88
STRIP_IN, STRIP_GAP_IN = 0.42, 0.07
"""Boxes in inches: every panel of a row is as high, so that B and C keep their scales."""
DOTS_PER_INCH = 300
FORMATS = {"svg": {"Date": None}, "png": {}, "pdf": {"CreationDate": None}}
"""Endings that are written, and metadata that is left out."""

COM_SPAN_MIN_M = 0.01
CONTROLLERS = (
    "Original: all boards move",
    "Distributed: the boards elect the one that moves",
)

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.0,
    "axes.labelsize": 7.0,
    "axes.labelpad": 3.0,
    "axes.titlesize": 7.5,
    "axes.titlepad": 5.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "svg.hashsalt": "decmesh",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}


class Boxes(NamedTuple):
    """Left edge and width of the panels, in inches."""

    orientations: tuple[float, float] = (0.62, 2.86)
    com: tuple[float, float] = (4.08, 1.22)
    body: tuple[float, float] = (5.8, 0.86)
    time: tuple[float, float] = (6.76, 0.07)


BOXES = Boxes()


def panels(trajectory: Trajectory, stem: Path) -> list[Path]:
    """Draw one run as the paper does; return the files written: `stem` with each ending.

    Raises OSError.
    """
    with style.context(["default", STYLE]):
        strip = trajectory.scenario.election.enabled
        return _save(stacked([("", trajectory)], strip=strip), stem)


def comparison(original: Trajectory, distributed: Trajectory, stem: Path) -> list[Path]:
    """Draw two runs of one body above each other, to the same scales; return the files written.

    Raises OSError.
    """
    with style.context(["default", STYLE]):
        runs = list(zip(CONTROLLERS, (original, distributed), strict=True))
        return _save(stacked(runs, strip=True), stem)


def stacked(runs: Sequence[tuple[str, Trajectory]], *, strip: bool) -> Figure:
    """Draw runs above each other, to the same scales, each below its title unless that is empty.

    `strip` shows which board was enabled when. To be called, as all that draws, in the style.
    """
    motions = [_motion(trajectory) for _title, trajectory in runs]
    heading_in = HEADING_IN if any(title for title, _trajectory in runs) else 0.0
    frame, height_in = _frame(motions), ROW_IN + heading_in
    figure = Figure(figsize=(WIDTH_IN, len(runs) * height_in), dpi=DOTS_PER_INCH)
    for row, (title, _trajectory) in enumerate(runs):
        bottom_in = (len(runs) - 1 - row) * height_in
        _row(figure, bottom_in, motions[row], frame, strip=strip)
        if title:
            top = (bottom_in + ROW_IN + 0.02) / (len(runs) * height_in)
            figure.text(0.01, top, title, weight="bold", size=8.5, va="bottom")
    return figure


def _motion(trajectory: Trajectory) -> Motion:
    boards, found = trajectory.scenario.boards, samples(trajectory)
    return Motion(
        trajectory,
        found.times_s,
        np.degrees(found.orientations_rad),
        com_m(boards, found.orientations_rad),
        joint_positions_m(boards, found.orientations_rad),
    )


def _frame(motions: Sequence[Motion]) -> Frame:
    """Find limits that hold everything in all motions."""
    ends_s = [motion.trajectory.ticks * motion.trajectory.tick_s for motion in motions]
    end_s = max(*ends_s, motions[0].trajectory.tick_s)
    degrees = np.concatenate([motion.orientations_deg.ravel() for motion in motions])
    margin_deg = 0.05 * max(float(np.ptp(degrees)), 1.0)
    ground_m = np.array([[x_m, y_m] for x_m in FOOT_M for y_m in (-0.04, 0.0)])
    bodies_m = [ground_m, *(motion.joints_m.reshape(-1, 2) for motion in motions)]
    return Frame(
        end_s,
        (float(degrees.min()) - margin_deg, float(degrees.max()) + margin_deg),
        _window([motion.com_m for motion in motions], BOXES.com[1], COM_SPAN_MIN_M),
        _window(bodies_m, BOXES.body[1], 0.0),
        # Most of a movement happens early: linear for a tenth of a second, then logarithmic.
        AsinhNorm(TIME_TICKS_S[0], vmin=0.0, vmax=end_s),
    )


def _window(points_m: Sequence[Floats], width_in: float, span_min_m: float) -> Window:
    """Fit points (n, 2) into a panel of that width with equal scales and a margin."""
    low, high = np.concatenate(points_m).min(axis=0), np.concatenate(points_m).max(axis=0)
    sizes_in = np.array([width_in, PANEL_IN])
    scale = 1.1 * float((np.maximum(high - low, span_min_m) / sizes_in).max())
    centre, half = (low + high) / 2.0, scale * sizes_in / 2.0
    (x0, y0), (x1, y1) = centre - half, centre + half
    return Window((float(x0), float(x1)), (float(y0), float(y1)))


def _axes(figure: Figure, left_width_in: tuple[float, float], bottom_in: float, in_: float) -> Axes:
    """Add axes whose place is given in inches; `in_` is the height."""
    width, height = figure.get_size_inches()
    left_in, width_in = left_width_in
    return figure.add_axes((left_in / width, bottom_in / height, width_in / width, in_ / height))


def _row(figure: Figure, bottom_in: float, motion: Motion, frame: Frame, *, strip: bool) -> None:
    """Draw the panels A, B and C of one motion side by side."""
    base_in = bottom_in + BOTTOM_IN
    raised_in = STRIP_IN + STRIP_GAP_IN if strip else 0.0
    a = _axes(figure, BOXES.orientations, base_in + raised_in, PANEL_IN - raised_in)
    drawing.draw_orientations(a, motion, frame)
    lowest = a
    if strip:
        lowest = _axes(figure, BOXES.orientations, base_in, STRIP_IN)
        drawing.draw_enabled(lowest, motion, frame)
        a.tick_params(labelbottom=False)
        figure.align_ylabels([a, lowest])
    lowest.set_xlabel("Time (s)")
    for axes in (a, lowest):
        axes.xaxis.set_major_locator(MaxNLocator(6))
    drawing.draw_centre_of_mass(_axes(figure, BOXES.com, base_in, PANEL_IN), motion, frame)
    drawing.draw_poses(_axes(figure, BOXES.body, base_in, PANEL_IN), motion, frame)
    drawing.draw_time_scale(figure, _axes(figure, BOXES.time, base_in, PANEL_IN), frame)


def _save(figure: Figure, stem: Path) -> list[Path]:
    paths = []
    for ending, metadata in FORMATS.items():
        path = stem.with_name(f"{stem.name}.{ending}")
        figure.savefig(path, metadata=metadata)
        paths.append(path)
    return paths
