from dataclasses import replace

import numpy as np
import pytest

from deploy.launch.twin import run_twin
from deploy.recording.epochs import NOT_KNOWN, Epochs, epochs
from deploy.recording.trajectory import Trajectory, recorded_trajectory, trajectory
from deploy.scenario_file.load import load
from tests.realtime.robot import Host, RealtimeRobot


def run(name: str, *settings: str) -> Trajectory:
    scenario = load(name, list(settings))
    return trajectory(scenario, *run_twin(scenario))


def found(run: Trajectory) -> Epochs:
    every = epochs(run)
    assert every is not None
    return every


@pytest.fixture(scope="module")
def lossy() -> Trajectory:
    return run("lossy", "run.duration_s=3")


def test_nobody_elects_in_the_original_controller() -> None:
    assert epochs(run("paper", "election.enabled=false", "run.duration_s=0.2")) is None


def test_an_epoch_counts_when_its_last_round_was_played() -> None:
    for duration_s, expected in ((0.102, 1), (0.103, 2)):
        every = found(run("paper", f"run.duration_s={duration_s}"))
        assert every.number.tolist() == list(range(expected))
        assert every.latch_tick.tolist() == [2, 102][:expected]


def test_known_after_is_what_a_walk_through_the_rounds_finds(lossy: Trajectory) -> None:
    """The same law said again, one board, one round at a time."""
    every, rounds = found(lossy), lossy.scenario.election.rounds
    for row, first in enumerate(every.first_tick):
        began = list(zip(lossy.urgency[first], lossy.candidate[first], strict=True))
        most = max(began)
        for board in range(3):
            knows = [
                (lossy.urgency[first + r, board], lossy.candidate[first + r, board]) == most
                for r in range(rounds + 1)
            ]
            expected = knows.index(True) if True in knows else NOT_KNOWN
            assert every.known_after[row, board] == expected
    assert NOT_KNOWN in every.known_after


def test_all_agree_when_the_last_member_knows(lossy: Trajectory) -> None:
    every = found(lossy)
    last = every.known_after.max(axis=1)
    never = (every.known_after == NOT_KNOWN).any(axis=1)
    assert np.array_equal(every.agreed_after, np.where(never, NOT_KNOWN, last))


def test_a_pulled_board_is_no_member_and_has_no_say() -> None:
    every = found(run("hotplug", "run.duration_s=6"))
    away = (every.first_tick >= 3000) & (every.first_tick < 5000)
    assert not every.members[away, 2].any()
    assert every.members[~away & (every.first_tick < 3000)].all()
    assert np.isnan(every.w_rad[away, 2]).all()
    assert (every.known_after[away, 2] == NOT_KNOWN).all()
    assert (every.agreed_after[away] != NOT_KNOWN).all()
    assert (every.enabled_boards == 1).all()


def test_of_equal_urgencies_the_higher_board_is_the_maximum(lossy: Trajectory) -> None:
    tied = replace(lossy, urgency=np.ones_like(lossy.urgency))
    boards = np.broadcast_to(np.arange(3), lossy.candidate.shape)
    every = found(replace(tied, candidate=boards))
    assert (every.known_after[:, 2] == 0).all()
    assert (every.known_after[:, :2] == NOT_KNOWN).all()


@pytest.mark.parametrize("ticks", [0, 1, 2])
def test_in_realtime_a_board_may_be_some_ticks_ahead(ticks: int) -> None:
    """It begins an epoch, and leaves the one before, when it reckons that the time has come."""
    scenario = load("paper", ["run.mode=realtime", "run.duration_s=0.5"])
    told = recorded_trajectory(RealtimeRobot(scenario, Host()).spool())
    names = ("state", "enabled", "epoch", "round", "urgency", "candidate")
    ahead = {name: getattr(told, name).copy() for name in names}
    for column in ahead.values():
        column[: len(column) - ticks, 1] = column[ticks:, 1]
    found, exact = epochs(replace(told, **ahead)), epochs(told)
    assert found is not None
    assert exact is not None
    assert found.members.all()
    assert np.isfinite(found.w_rad).all()
    np.testing.assert_array_equal(found.enabled, exact.enabled)
    np.testing.assert_array_equal(found.w_rad, exact.w_rad)
