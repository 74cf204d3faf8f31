from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from deploy.recording.arrays import Recording
from deploy.recording.epochs import NOT_KNOWN, Epochs, epochs
from deploy.recording.frame_fate import FrameFate
from deploy.recording.link_counts import MISSED
from deploy.report.charts.spacetime import MARKS, Scene, outcome, spacetime, telling_epoch
from tests.deploy.recordings import recording, run

pytestmark = pytest.mark.slow


def elected(of: Recording) -> Epochs:
    found = epochs(of.trajectory)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def stormy() -> Recording:
    return recording(run("storm"))


def arrows(axes: Axes) -> int:
    return sum(getattr(text, "arrow_patch", None) is not None for text in axes.texts)


def marks(axes: Axes) -> int:
    """Marks of frames that broke off: the only single points that are not on a board's line."""
    points = [line.get_xydata() for line in axes.lines if line.get_linestyle() == "None"]
    heights = [float(np.asarray(point)[0, 1]) for point in points]
    return sum(height % 1.0 != 0.0 for height in heights)


def test_every_frame_of_the_rounds_arrives_or_breaks_off(stormy: Recording) -> None:
    found = elected(stormy)
    for row in (0, 7, 42, 99):
        rounds = slice(found.first_tick[row], found.latch_tick[row])
        fates = [FrameFate(fate) for link in stormy.links.values() for fate in link.fate[rounds]]
        axes = spacetime(Scene(stormy, found, row)).axes[0]
        assert arrows(axes) == sum(fate in (FrameFate.HEARD, FrameFate.LATE) for fate in fates)
        assert marks(axes) == sum(fate in MARKS for fate in fates) > 0


def test_every_fate_is_an_arrow_a_mark_or_nothing_at_all() -> None:
    assert set(MARKS) == set(FrameFate) - {FrameFate.HEARD, FrameFate.LATE, FrameFate.UNSAID}


def test_the_first_epoch_that_lost_a_frame_is_shown(stormy: Recording) -> None:
    found = elected(stormy)
    clean_until = 40
    links = {
        pair: replace(
            link,
            fate=np.where(
                np.arange(len(link.fate)) < found.first_tick[clean_until], FrameFate.LATE, link.fate
            ),
        )
        for pair, link in stormy.links.items()
    }
    shown = telling_epoch(replace(stormy, links=links), found)
    lost = [
        row
        for row in range(len(found.number))
        if any(
            fate in MISSED
            for link in links.values()
            for fate in link.fate[found.first_tick[row] : found.latch_tick[row]]
        )
    ]
    assert shown == lost[0] >= clean_until


def test_without_a_lost_frame_it_is_the_first_epoch(stormy: Recording) -> None:
    links = {
        pair: replace(link, fate=np.full_like(link.fate, FrameFate.HEARD))
        for pair, link in stormy.links.items()
    }
    assert telling_epoch(replace(stormy, links=links), elected(stormy)) == 0


def test_the_outcome_of_an_epoch_in_words(stormy: Recording) -> None:
    found = elected(stormy)
    assert outcome(Scene(stormy, found, 0)) == ("all knew the maximum after 7 rounds; enabled: hip")
    several = int(np.flatnonzero(found.enabled_boards > 1)[0])
    assert outcome(Scene(stormy, found, several)).count(",") == found.enabled_boards[several] - 1
    never = int(np.flatnonzero(found.agreed_after == NOT_KNOWN)[0])
    assert outcome(Scene(stormy, found, never)).startswith("the boards never agreed; ")
    none = replace(found, enabled=np.zeros_like(found.enabled))
    assert outcome(Scene(stormy, none, 0)).endswith("enabled: none")


def test_a_joint_without_a_board_is_drawn_as_such() -> None:
    """Board 2 is away from tick 3000 on: no knot on its line, and nothing that it says."""
    of = recording(run("hotplug"))
    axes = spacetime(Scene(of, elected(of), 35)).axes[0]
    assert axes.get_yticklabels()[2].get_text() == "hip\ntakes no part"
    knots = [line for line in axes.lines if line.get_marker() == "o"]
    assert {float(np.asarray(knot.get_ydata())[0]) for knot in knots} == {0.0, 1.0}
