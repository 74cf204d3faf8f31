"""What happened to a robot, drawn as a timeline: a lane for each thing that it happened to.

Rule 1: a label is written where it has room, cut short where it has little, left out where it has
        none: the table of happenings has them all.
Rule 2: a delay line that is filled in no time has no label: it would be taken for that of the gap
        before it.
Rule 3: kinds differ in lightness and hatching, not in colour alone; colours are no board's.
"""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes

from deploy.outcome.drawing import INK
from deploy.report.sections.happenings import HappeningKind, Span

LETTER_IN = 0.05
"""Width of a letter of a label, about."""
SHORTENED_LETTERS_MIN = 12
HALO = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
"""Behind a label on hatching."""
LOOKS: dict[HappeningKind, dict[str, Any]] = {
    HappeningKind.CUT: {"facecolor": "#222222", "edgecolor": "none"},
    HappeningKind.FAULTS: {"facecolor": "#ddcc77", "edgecolor": "none"},
    HappeningKind.AWAY: {"facecolor": "white", "edgecolor": "0.55", "hatch": "/////"},
    HappeningKind.SYNCING: {"facecolor": "0.8", "edgecolor": "0.55"},
    HappeningKind.SAFE: {"facecolor": "#ddaa99", "edgecolor": "none"},
    HappeningKind.FAULT: {"facecolor": "#993322", "edgecolor": "none"},
    HappeningKind.PUSH: {"facecolor": "#882255", "edgecolor": "none"},
    HappeningKind.APART: {"facecolor": "#bbbbbb", "edgecolor": "none"},
}
ON_DARK = {HappeningKind.CUT, HappeningKind.PUSH, HappeningKind.FAULT}


def lanes_of(happened: Sequence[Span]) -> list[str]:
    """Names of the lanes, from the top down."""
    return list(dict.fromkeys(span.lane for span in happened))


def draw_timeline(
    axes: Axes, happened: Sequence[Span], tick_s: float, end_s: float, width_in: float
) -> None:
    """Draw all spans on axes that are `width_in` wide and end at `end_s`; name no lanes."""
    letter_s = LETTER_IN * end_s / width_in
    for row, lane in enumerate(reversed(lanes_of(happened))):
        spans = [span for span in happened if span.lane == lane]
        for span in spans:
            start_s, length_s = span.first_tick * tick_s, _ticks(span) * tick_s
            if span.kind is HappeningKind.MOMENT:
                axes.plot([start_s], [row], "D", color=INK, markersize=2.6, clip_on=False)
            else:
                drawn_s = max(length_s, 0.2 * letter_s)
                axes.barh(row, drawn_s, 0.7, start_s, linewidth=0.3, **LOOKS[span.kind])
        labelled = [
            span
            for span in spans
            if span.kind is not HappeningKind.SYNCING or _ticks(span) * tick_s > letter_s
        ]
        afters = [*labelled[1:], None][: len(labelled)]
        for span, after in zip(labelled, afters, strict=True):
            start_s, length_s = span.first_tick * tick_s, _ticks(span) * tick_s
            next_s = end_s if after is None else after.first_tick * tick_s
            within = int(length_s / letter_s) - 1
            behind = int((next_s - start_s - length_s) / letter_s) - 1
            inside = within >= min(len(span.label), behind)
            axes.text(
                start_s + letter_s + (0.0 if inside else length_s),
                row,
                shortened(span.label, within if inside else behind),
                size=5.5,
                va="center",
                color="white" if inside and span.kind in ON_DARK else INK,
                bbox=HALO if inside and span.kind is HappeningKind.AWAY else None,
                zorder=3,
            )


def _ticks(span: Span) -> int:
    return span.end_tick - span.first_tick


def shortened(text: str, letters: int) -> str:
    """Cut a text to so many letters, or leave it out where too little would be left of it."""
    if len(text) <= letters:
        return text
    return f"{text[: letters - 1]}…" if letters > SHORTENED_LETTERS_MIN else ""
