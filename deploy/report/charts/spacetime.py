"""A round of max-consensus to be seen: boards as lines, ticks from left to right, frames as arrows.

Rule 1: a knot is what a board knew at the end of a tick, in the colour of the board whose w is the
        largest that it knew of. So the maximum is seen to spread in its colour.
Rule 2: an arrow is one frame, from the tick it was said in to the tick it was first used in, in
        the colour of what it said. One that was not used breaks off, with a mark for the reason.
Rule 3: what a board learned is drawn heavier than what it knew already.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from deploy.outcome.drawing import INK, PALE, board_colour
from deploy.outcome.figures import DOTS_PER_INCH, WIDTH_IN
from deploy.recording.arrays import LinkHistory, Recording
from deploy.recording.epochs import NOT_KNOWN, Epochs
from deploy.recording.frame_fate import FrameFate
from deploy.recording.link_counts import MISSED
from deploy.recording.trajectory import Floats

LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 0.98, 0.78, 0.3, 0.62
HEIGHT_IN_MAX = 11.0
LETTER_IN = 0.055
"""Width of a letter of a label, about."""
BROKEN_AT = 0.4
"""Where a lost frame ends on its way: not half way, where those of both directions meet."""
BEYOND_MAX = 0.55
"""How far past the last round the picture goes, in ticks; less where there are few rounds."""
MARKS = {
    FrameFate.LOST: "x",
    FrameFate.CORRUPT: "s",
    FrameFate.CUT: "|",
    FrameFate.NOBODY: "o",
    FrameFate.VOID: "D",
    FrameFate.PENDING: ">",
}
GREY = "0.6"


class Scene(NamedTuple):
    """One epoch of one run, as it is drawn."""

    recording: Recording
    epochs: Epochs
    row: int
    """Which of the epochs, as an index into their arrays."""

    @property
    def first_tick(self) -> int:
        """The tick in which the epoch began."""
        return int(self.epochs.first_tick[self.row])

    @property
    def rounds(self) -> int:
        """How many rounds were played."""
        return int(self.epochs.latch_tick[self.row]) - self.first_tick

    @property
    def right(self) -> float:
        """Where the picture ends, in rounds."""
        return self.rounds + min(BEYOND_MAX, 0.12 * self.rounds)

    @property
    def joints(self) -> list[str]:
        """Names of the boards."""
        return self.recording.trajectory.scenario.joints


def telling_epoch(recording: Recording, epochs: Epochs) -> int:
    """The first epoch in which a frame was lost on its way; if none was, the first.

    Returns the index into the arrays of `epochs`.
    """
    for row, (first, latch) in enumerate(zip(epochs.first_tick, epochs.latch_tick, strict=True)):
        fates = [link.fate[first:latch] for link in recording.links.values()]
        if np.isin(fates, MISSED).any():
            return row
    return 0


def outcome(scene: Scene) -> str:
    """What came of the epoch, in words."""
    epochs, row = scene.epochs, scene.row
    rounds = int(epochs.agreed_after[row])
    agreed = (
        "the boards never agreed"
        if rounds == NOT_KNOWN
        else f"all knew the maximum after {rounds} round{'s' * (rounds != 1)}"
    )
    enabled = [scene.joints[board] for board in np.flatnonzero(epochs.enabled[row])]
    return f"{agreed}; enabled: {', '.join(enabled) or 'none'}"


def spacetime(scene: Scene) -> Figure:
    """Draw the rounds of one epoch."""
    boards = len(scene.joints)
    row_in = min(0.62, (HEIGHT_IN_MAX - TOP_IN - BOTTOM_IN) / boards)
    height_in = TOP_IN + BOTTOM_IN + row_in * boards
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DOTS_PER_INCH)
    width_in = WIDTH_IN - LEFT_IN - RIGHT_IN
    axes = figure.add_axes(
        (
            LEFT_IN / WIDTH_IN,
            BOTTOM_IN / height_in,
            width_in / WIDTH_IN,
            row_in * boards / height_in,
        )
    )
    axes.set(xlim=(-0.06 * scene.right, scene.right), ylim=(-0.5, boards - 0.5))
    for board in range(boards):
        _draw_board(axes, scene, board)
    used = [
        fate
        for (sender, receiver), link in sorted(scene.recording.links.items())
        for fate in _draw_frames(axes, scene, link, sender, receiver)
    ]
    _name_axes(axes, scene)
    _draw_legend(axes, used)
    number = int(scene.epochs.number[scene.row])
    axes.set_title(
        rf"$\bf{{Epoch\ {number}}}$  {outcome(scene)}", loc="left", x=-LEFT_IN / width_in + 0.01
    )
    return figure


def _draw_board(axes: Axes, scene: Scene, board: int) -> None:
    """Draw the line of a board and its knots, and write what it learned and when."""
    trajectory, joints = scene.recording.trajectory, scene.joints
    ticks = slice(scene.first_tick, scene.first_tick + scene.rounds + 1)
    there = trajectory.state[ticks, board] > 0
    playing = there & (trajectory.epoch[ticks, board] == scene.epochs.number[scene.row])
    axes.axhline(board, color=PALE, linewidth=1.4 if there.all() else 0.7, zorder=0)
    before = None
    for round_ in range(scene.rounds + 1):
        if not there[round_]:
            continue
        if not playing[round_]:
            axes.plot(round_, board, "o", markersize=4.0, color=GREY, markerfacecolor="white")
            continue
        tick = scene.first_tick + round_
        candidate = int(trajectory.candidate[tick, board])
        colour = board_colour(candidate, len(joints))
        axes.plot(round_, board, "o", markersize=6.5, color=colour, zorder=4)
        if round_ > 0 and candidate != before:
            w_deg = np.degrees(trajectory.urgency[tick, board])
            axes.annotate(
                _fitting([f"{joints[candidate]} {w_deg:.3g}°", joints[candidate]], scene),
                (round_, board),
                (0.0, 6.0 if board else -11.5),  # Below the lowest line there are no arrows.
                textcoords="offset points",
                size=6.0,
                color=INK,
                ha="center",
                zorder=5,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
            )
        before = candidate


def _fitting(labels: Sequence[str], scene: Scene) -> str:
    """The first of some labels that is no wider than a round; none: the colour says it too."""
    letters = (WIDTH_IN - LEFT_IN - RIGHT_IN) / scene.right / LETTER_IN
    return next((label for label in labels if len(label) <= letters), "")


def _draw_frames(
    axes: Axes, scene: Scene, link: LinkHistory, sender: int, receiver: int
) -> list[FrameFate]:
    """Draw what one board said to another in these rounds; return what became of the frames."""
    used: list[FrameFate] = []
    for round_ in range(scene.rounds):
        tick = scene.first_tick + round_
        fate = FrameFate(int(link.fate[tick]))
        if fate is FrameFate.UNSAID:
            continue
        used.append(fate)
        colour = _said_colour(scene, tick, sender)
        heard = int(link.heard_tick[tick]) - scene.first_tick
        start = np.array([round_, sender], dtype=np.float64)
        if fate in MARKS:
            way = np.array([1.0, receiver - sender])
            x, y = start + BROKEN_AT * way
            axes.plot([round_, x], [sender, y], color=colour, linewidth=0.9, zorder=2)
            axes.plot(x, y, MARKS[fate], color=INK, markersize=4.2, markeredgewidth=1.1, zorder=3)
            continue
        learned = _learned(scene, tick, sender, heard, receiver)
        end = _clipped(start, np.array([heard, receiver], dtype=np.float64), scene.right)
        axes.annotate(
            "",
            (float(end[0]), float(end[1])),
            (float(start[0]), float(start[1])),
            arrowprops={
                "arrowstyle": "-|>" if end[0] == heard else "-",
                "color": colour,
                "linewidth": 1.7 if learned else 0.8,
                "linestyle": "-" if fate is FrameFate.HEARD else (0, (4, 2)),
                "mutation_scale": 7.0,
                "shrinkA": 3.5,
                "shrinkB": 4.0 if end[0] == heard else 0.0,
            },
            zorder=3 if learned else 2,
        )
    return used


def _said_colour(scene: Scene, tick: int, sender: int) -> object:
    """The colour of the board whose w the sender took for the largest."""
    trajectory = scene.recording.trajectory
    if trajectory.epoch[tick, sender] != scene.epochs.number[scene.row]:
        return GREY
    return board_colour(int(trajectory.candidate[tick, sender]), len(scene.joints))


def _learned(scene: Scene, tick: int, sender: int, heard: int, receiver: int) -> bool:
    """Whether the receiver took over what it heard, and had not known it."""
    trajectory, then = scene.recording.trajectory, scene.first_tick + heard
    if heard > scene.rounds or _said_colour(scene, tick, sender) == GREY:
        return False
    said = trajectory.candidate[tick, sender]
    now, before = trajectory.candidate[then, receiver], trajectory.candidate[then - 1, receiver]
    return bool(now == said != before)


def _clipped(start: Floats, end: Floats, right: float) -> Floats:
    """Where an arrow leaves the picture, if it does."""
    if end[0] <= right:
        return end
    share = (right - start[0]) / (end[0] - start[0])
    clipped: Floats = start + share * (end - start)
    return clipped


def _name_axes(axes: Axes, scene: Scene) -> None:
    """Name boards with their own w on the left, what became of them on the right, and rounds."""
    epochs, row = scene.epochs, scene.row
    names = []
    for board, joint in enumerate(scene.joints):
        member = epochs.members[row, board]
        own = f"w = {np.degrees(epochs.w_rad[row, board]):.3g}°" if member else "takes no part"
        names.append(f"{joint}\n{own}")
        if member:
            enabled = epochs.enabled[row, board]
            axes.text(
                1.01,
                board,
                "enabled" if enabled else "holds",
                va="center",
                transform=axes.get_yaxis_transform(),
                size=7.0,
                weight="bold" if enabled else "normal",
                color=board_colour(board, len(scene.joints)) if enabled else "0.45",
            )
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="both", length=0.0)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    rounds = range(scene.rounds + 1)
    step = 1 + scene.rounds // 16
    shown = list(rounds[::step])
    labels = [f"{round_}\n{scene.first_tick + round_}" for round_ in shown]
    labels[0] = f"round 0\ntick {scene.first_tick}"
    axes.set_xticks(shown, labels)
    for round_ in rounds:
        axes.axvline(round_, color="0.93", linewidth=0.6, zorder=-1)


def _draw_legend(axes: Axes, used: list[FrameFate]) -> None:
    """Explain the arrows and marks that are there."""
    lines = [Line2D([], [], color=INK, linewidth=1.7, label="heard, and news")]
    lines.append(Line2D([], [], color=INK, linewidth=0.8, label="heard, known already"))
    if FrameFate.LATE in used:
        lines.append(Line2D([], [], color=INK, linewidth=0.8, linestyle=(0, (4, 2)), label="late"))
    for fate, marker in MARKS.items():
        if fate in used:
            lines.append(Line2D([], [], color=INK, linestyle="none", marker=marker, markersize=4.2))
            lines[-1].set_label(fate.name.lower())
    axes.legend(
        handles=lines,
        loc="upper left",
        bbox_to_anchor=(0.0, 0.0, 1.0, 0.0),
        bbox_transform=axes.get_xaxis_transform(which="tick1"),
        borderaxespad=3.6,
        ncols=len(lines),
        columnspacing=1.4,
        handletextpad=0.5,
        fontsize=6.0,
    )
