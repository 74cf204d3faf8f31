from dataclasses import replace

import numpy as np
import pytest

from deploy.recording.epochs import epochs
from deploy.recording.latency import (
    decisions_ns,
    gaps_ns,
    spread,
    ticks_ns,
    waits,
    ways_ns,
)
from deploy.recording.trajectory import Trajectory
from tests.deploy.recordings import recording, run


@pytest.fixture(scope="module")
def hotplug() -> Trajectory:
    return run("hotplug")


@pytest.mark.parametrize("size", [2, 3, 10, 101, 5000])
def test_a_percentile_is_the_least_value_that_so_many_do_not_exceed(size: int) -> None:
    values = np.random.default_rng(size).integers(0, 60, size).astype(np.float64)
    found = spread(np.concatenate([values, [np.nan, np.nan]]))
    assert found is not None
    assert (found.known, found.most) == (size, max(values))
    for percent, value in zip((50, 90, 99), found[1:4], strict=True):
        assert value in values
        assert 100 * (values <= value).sum() >= percent * size
        assert 100 * (values < value).sum() < percent * size


def test_what_is_not_known_is_in_no_statistic() -> None:
    assert spread(np.array([np.nan, np.nan])) is None
    assert spread(np.array([])) is None
    assert spread(np.array([3.0, np.nan])) == (1, 3.0, 3.0, 3.0, 3.0)


def test_a_decision_takes_from_the_epochs_opening_to_the_last_rounds_thought(
    hotplug: Trajectory,
) -> None:
    of, found = recording(hotplug), epochs(hotplug)
    assert found is not None
    took_ns = decisions_ns(of, found)
    for row, (first, latch) in enumerate(zip(found.first_tick, found.latch_tick, strict=True)):
        for board in range(3):
            if found.members[row, board]:
                expected = of.decided_ns[latch, board] - of.opened_ns[first]
                assert took_ns[row, board] == expected
            else:
                assert np.isnan(took_ns[row, board])
    assert not found.members.all()


def test_clocks_that_are_not_one_are_not_subtracted(hotplug: Trajectory) -> None:
    shared, found = recording(hotplug), epochs(hotplug)
    assert found is not None
    apart = replace(
        shared, clocks_shared=False, decided_ns=shared.decided_ns + 10**15, said_ns=shared.said_ns
    )
    took_ns = decisions_ns(apart, found)
    expected_ns = shared.answered_ns[found.latch_tick] - shared.opened_ns[found.first_tick, None]
    assert np.array_equal(took_ns[found.members], expected_ns[found.members])


def test_a_twin_has_no_wall_time(hotplug: Trajectory) -> None:
    of, found = recording(hotplug, timed=False), epochs(hotplug)
    assert found is not None
    for values in (decisions_ns(of, found), ticks_ns(of), gaps_ns(of)):
        assert spread(values) is None
    assert all(spread(ways_ns(link)) is None for link in of.links.values())
    assert waits(of).ticks == 0


def test_the_board_that_answers_last_is_the_one_that_was_waited_for(hotplug: Trajectory) -> None:
    of = recording(hotplug)
    found = waits(of)
    assert found.ticks == hotplug.ticks == found.last.sum()
    for tick in (0, 1, 3500, 9999):
        answered = sorted(of.answered_ns[tick][of.answered_ns[tick] > 0])
        assert of.answered_ns[tick, found.whose[tick]] == answered[-1]
        assert found.alone_ns[tick] == answered[-1] - answered[-2]
    assert 2 not in found.whose[3000:5000]  # Its board was pulled.


def test_a_tick_and_the_gap_after_it_are_the_time_to_the_next_tick(hotplug: Trajectory) -> None:
    of = recording(hotplug)
    assert np.array_equal(ticks_ns(of)[:-1] + gaps_ns(of), np.diff(of.opened_ns))
