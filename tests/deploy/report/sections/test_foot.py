"""The foot in a report: within its sole, its margin as in the summary, and only where it is."""

import numpy as np
import pytest

from deploy.outcome.foot_margin import foot_margin
from deploy.report.page import Figure, PageTable
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun, look_at
from deploy.report.sections.foot import draw_foot, foot
from tests.deploy.recordings import recording, run

HEEL = "board.0.foot={ahead_m=0.2, behind_m=0.005}"
"""So short that the paper's movement tips it."""


@pytest.fixture(scope="module")
def tipping() -> ReportedRun:
    return look_at(recording(run("paper", "run.duration_s=1", HEEL)), "tipping")


def test_the_pressure_is_drawn_within_the_sole(tipping: ReportedRun) -> None:
    (axes,) = draw_foot(tipping).axes
    pressure, marks = axes.lines
    drawn_mm = np.asarray(pressure.get_ydata(), dtype=np.float64)
    assert np.nanmin(drawn_mm) == pytest.approx(-5.0)
    assert np.nanmax(drawn_mm) < 200.0
    assert len(np.asarray(marks.get_xdata())) > 0


def test_the_margin_is_that_of_the_summary(tipping: ReportedRun) -> None:
    figure, table = foot([tipping], Pictures(several=False))
    found = foot_margin(tipping.recording.trajectory)
    assert isinstance(figure, Figure)
    assert isinstance(table, PageTable)
    assert found is not None
    assert found.tipping_ticks > 0
    assert table.rows == [["the sole", "0.0", str(found.tipping_ticks)]]


def test_a_body_without_a_foot_has_no_word_of_it(tipping: ReportedRun) -> None:
    bare = look_at(recording(run("paper", "run.duration_s=0.3")), "bare", 2)
    assert foot([bare], Pictures(several=False)) == []
    _, table = foot([tipping, bare], Pictures(several=True))
    assert isinstance(table, PageTable)
    assert [row[0] for row in table.rows] == ["tipping"]
