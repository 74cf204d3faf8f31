"""Labels of the timeline: each says what its own box is."""

import pytest
from matplotlib.figure import Figure

from deploy.report.charts.timeline import draw_timeline
from deploy.report.sections.happenings import HappeningKind, Span

AWAY, SYNCING, FAULT = (
    str(HappeningKind.AWAY),
    str(HappeningKind.SYNCING),
    "fault 1: controller raised",
)


def written(*spans: Span) -> list[str]:
    """Labels of ten seconds on axes of six inches, in which a letter takes 80 ticks."""
    axes = Figure().add_subplot()
    draw_timeline(axes, spans, 0.001, 10.0, 6.0)
    return [text.get_text() for text in axes.texts if text.get_text()]


@pytest.mark.parametrize(
    ("gone", "filled", "labels"),
    [
        (4500, 4510, [AWAY]),
        (7000, 7010, [AWAY]),
        (4500, 8000, [SYNCING]),
        (7000, 9900, [AWAY, SYNCING]),
    ],
)
def test_a_gap_is_not_taken_for_a_delay_line(gone: int, filled: int, labels: list[str]) -> None:
    away = Span("hip", 4000, gone, HappeningKind.AWAY, AWAY)
    assert written(away, Span("hip", gone, filled, HappeningKind.SYNCING, SYNCING)) == labels


def test_a_short_fault_is_named_behind_its_box() -> None:
    assert written(Span("hip", 100, 110, HappeningKind.FAULT, FAULT)) == [FAULT]
