"""The elections of a run over its time, in strips above each other, and what happened below them.

Rule 1: all strips have one time axis; strips of several runs have the same one.
Rule 2: a strip is as high as its rows need, so that ten boards can be read as well as three.
Rule 3: what there is one of per tick or epoch, and there are many, is drawn as pixels.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from deploy.outcome.drawing import INK, PALE, board_colour, spans
from deploy.outcome.figures import DOTS_PER_INCH, WIDTH_IN
from deploy.recording.arrays import Recording
from deploy.recording.epochs import NOT_KNOWN, Epochs
from deploy.recording.link_counts import missed_share
from deploy.report.charts.timeline import LOOKS, draw_timeline, lanes_of
from deploy.report.sections.happenings import HappeningKind, Span, absence

LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN, GAP_IN = 0.98, 0.12, 0.2, 0.36, 0.2
BOARD_ROW_IN, LINK_ROW_IN, LANE_IN = 0.16, 0.12, 0.17
PLOT_IN = WIDTH_IN - LEFT_IN - RIGHT_IN
ROWS_IN_MIN = 0.3
W_IN, ROUNDS_IN = 1.0, 0.62
MISSED_BIN_S = 0.1
"""Without epochs, frames are counted in stretches of this length."""
W_FLOOR_DEG = 1e-3
"""An error of less is drawn as this much: the scale is logarithmic."""
MARKS_MANY = 120
"""More epochs than this have no markers."""
MISSED = LinearSegmentedColormap.from_list("missed", ["#f4f4f2", "#b9b9b9", "#555555", "#000000"])


class Strips(NamedTuple):
    """What the strips of one run are drawn from."""

    recording: Recording
    epochs: Epochs | None
    happened: Sequence[Span]


class Limits(NamedTuple):
    """What the strips of several runs have in common."""

    end_s: float
    w_deg: tuple[float, float]
    rounds: int


def limits(runs: Sequence[Strips]) -> Limits:
    """Find limits that hold everything in all runs."""
    end_s = max(max(run.recording.trajectory.ticks, 1) * _tick_s(run) for run in runs)
    every = [run.epochs for run in runs if run.epochs is not None]
    w_deg = np.concatenate([[1.0], *(np.degrees(found.w_rad).ravel() for found in every)])
    known = w_deg[np.isfinite(w_deg) & (w_deg > W_FLOOR_DEG)]
    rounds = [run.recording.trajectory.scenario.election.rounds for run in runs]
    low, high = float(known.min()), float(known.max())
    return Limits(end_s, (max(0.6 * low, W_FLOOR_DEG), 1.7 * high), max(rounds))


def strips(run: Strips, shared: Limits) -> Figure:
    """Draw who was enabled, w, rounds to agreement, missed frames, and what happened below."""
    trajectory = run.recording.trajectory
    boards = trajectory.torques_nm.shape[1]
    lanes = lanes_of(run.happened)
    heights = [max(ROWS_IN_MIN, BOARD_ROW_IN * (boards + 1))]
    if run.epochs is not None:
        heights += [W_IN, ROUNDS_IN]
    if run.recording.links:
        heights += [max(ROWS_IN_MIN, LINK_ROW_IN * len(run.recording.links))]
    heights += [LANE_IN * len(lanes)] * bool(lanes)
    rows = iter(_stack(heights, shared.end_s))
    axes = next(rows)
    figure = axes.figure
    assert isinstance(figure, Figure)
    _draw_enabled(axes, run)
    if run.epochs is not None:
        _draw_w(next(rows), run, run.epochs, shared)
        _draw_rounds(next(rows), run, run.epochs, shared)
    if run.recording.links:
        _draw_missed(next(rows), run, shared.end_s)
    if lanes:
        axes = next(rows)
        draw_timeline(axes, run.happened, _tick_s(run), shared.end_s, PLOT_IN)
        _name_rows(axes, lanes[::-1])
        _title(axes, "Faults and commands")
    figure.axes[-1].tick_params(labelbottom=True)
    figure.axes[-1].set_xlabel("Time (s)")
    return figure


def _stack(heights_in: Sequence[float], end_s: float) -> list[Axes]:
    """Place axes below each other on one time axis."""
    whole_in = TOP_IN + sum(heights_in) + GAP_IN * (len(heights_in) - 1) + BOTTOM_IN
    figure = Figure(figsize=(WIDTH_IN, whole_in), dpi=DOTS_PER_INCH)
    found, top_in = [], whole_in - TOP_IN
    for height_in in heights_in:
        bottom = (top_in - height_in) / whole_in
        axes = figure.add_axes(
            (LEFT_IN / WIDTH_IN, bottom, PLOT_IN / WIDTH_IN, height_in / whole_in)
        )
        axes.set_xlim(0.0, end_s)
        axes.xaxis.set_major_locator(MaxNLocator(10))
        axes.tick_params(labelbottom=False)
        found.append(axes)
        top_in -= height_in + GAP_IN
    return found


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", pad=3.0, size=7.0, color="0.2", weight="bold")


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Name rows from the bottom up, without an axis."""
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.tick_params(axis="y", length=0.0, labelsize=6.0)
    axes.spines["left"].set_visible(False)


def _draw_enabled(axes: Axes, run: Strips) -> None:
    """One row per board: filled while enabled, hatched without a board; wrong epochs on top."""
    trajectory, tick_s = run.recording.trajectory, _tick_s(run)
    joints = _joints(run)
    named = False
    for board in range(len(joints)):
        bars = _bars(trajectory.enabled[:, board] > 0, tick_s)
        colour = board_colour(board, len(joints))
        axes.broken_barh(bars, (board - 0.38, 0.76), facecolors=colour, linewidth=0)
        gone = _bars(trajectory.state[:, board] == 0, tick_s)
        hatched = axes.broken_barh(
            gone, (board - 0.38, 0.76), linewidth=0.0, **LOOKS[HappeningKind.AWAY]
        )
        if gone and not named:
            hatched.set_label(absence(trajectory.scenario))
        named = named or bool(gone)
    top, names = len(joints), [*joints]
    if run.epochs is not None:
        names.append("not one")
        times_s, enabled = run.epochs.latch_tick * tick_s, run.epochs.enabled_boards
        for wrong, marker, label in ((enabled == 0, "o", "none"), (enabled > 1, "^", "several")):
            axes.plot(
                times_s[wrong],
                np.full(int(wrong.sum()), float(top)),
                marker,
                markersize=3.2,
                markerfacecolor="white" if marker == "o" else INK,
                markeredgecolor=INK,
                markeredgewidth=0.7,
                label=f"{label} enabled: {int(wrong.sum())} of {len(wrong)} epochs",
                clip_on=False,
            )
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=3,
            borderaxespad=0.1,
            columnspacing=1.2,
            handletextpad=0.4,
            handlelength=1.2,
            fontsize=6.0,
        )
    _name_rows(axes, names)
    _title(axes, "Enabled boards")


def _draw_w(axes: Axes, run: Strips, epochs: Epochs, shared: Limits) -> None:
    """Each w over the epochs, on a logarithmic scale."""
    joints, times_s = _joints(run), epochs.first_tick * _tick_s(run)
    w_deg = np.maximum(np.degrees(epochs.w_rad), W_FLOOR_DEG)
    few = len(times_s) <= MARKS_MANY
    for board in range(len(joints)):
        axes.plot(
            times_s,
            w_deg[:, board],
            color=board_colour(board, len(joints)),
            linewidth=0.8,
            marker="o" if few else "",
            markersize=1.6,
        )
    axes.set_yscale("log")
    axes.set_ylim(shared.w_deg)
    axes.yaxis.set_major_locator(LogLocator(10.0, numticks=6))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:g}°"))
    axes.grid(visible=True, axis="y", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    _title(axes, "w: size of each board's error when the epoch began, in the colours above")


def _draw_rounds(axes: Axes, run: Strips, epochs: Epochs, shared: Limits) -> None:
    """After how many rounds all knew the maximum, a dot for each epoch."""
    times_s, agreed = epochs.first_tick * _tick_s(run), epochs.agreed_after
    never, top = agreed == NOT_KNOWN, 1.3 * shared.rounds
    size = 2.0 if len(times_s) <= MARKS_MANY else 1.2
    axes.plot(times_s[~never], agreed[~never], "o", color=INK, markersize=size, clip_on=False)
    axes.plot(
        times_s[never],
        np.full(int(never.sum()), top),
        "x",
        color="#882255",
        markersize=size + 1.2,
        markeredgewidth=0.8,
        clip_on=False,
    )
    step = 1 + shared.rounds // 5
    every = range(0, shared.rounds + 1, step)
    axes.set_yticks([*every, top], [*map(str, every), "never"])
    axes.set_ylim(-0.06 * top, 1.06 * top)
    axes.tick_params(axis="y", labelsize=6.0)
    axes.grid(visible=True, axis="y", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    _title(axes, "Rounds until all agreed")


def _draw_missed(axes: Axes, run: Strips, shared_end_s: float) -> None:
    """One row per directed link: the darker, the more frames were lost or void."""
    trajectory, joints = run.recording.trajectory, _joints(run)
    election = trajectory.scenario.election
    bin_ticks = election.period_ticks if run.epochs else max(1, round(MISSED_BIN_S / _tick_s(run)))
    pairs = sorted(run.recording.links)
    share = np.array([missed_share(run.recording.links[pair], bin_ticks) for pair in pairs])
    end_s = share.shape[1] * bin_ticks * _tick_s(run)
    axes.imshow(
        np.ma.masked_invalid(share),
        aspect="auto",
        interpolation="nearest",
        origin="lower",
        cmap=MISSED,
        vmin=0.0,
        vmax=1.0,
        extent=(0.0, end_s, -0.5, len(pairs) - 0.5),
    )
    axes.set_xlim(0.0, shared_end_s)
    _name_rows(axes, [f"{joints[sender]} → {joints[receiver]}" for sender, receiver in pairs])
    axes.set_ylim(-0.5, len(pairs) - 0.5)
    _title(axes, "Frames lost on their way: light none, black all, white nobody there")


def _bars(true: NDArray[np.bool_], tick_s: float) -> list[tuple[float, float]]:
    return [(first * tick_s, (end - first) * tick_s) for first, end in spans(true)]


def _tick_s(run: Strips) -> float:
    return run.recording.trajectory.tick_s


def _joints(run: Strips) -> list[str]:
    return run.recording.trajectory.scenario.joints
