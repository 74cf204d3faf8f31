"""The two controllers that come along do what their pages say."""

from functools import cache
from math import degrees

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.indices import all_indices, elections
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from deploy.scenarios.hysteresis import MARGIN, Hysteresis
from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.election import Election, Gossip, HeardGossip
from protocol.wire.wiring import neighbours
from tests.module_agent.robot import config

pytestmark = pytest.mark.slow


@cache
def run(scenario: str, *settings: str) -> Trajectory:
    resolved = load(scenario, list(settings))
    return trajectory(resolved, *run_twin(resolved))


def winners(moved: Trajectory) -> list[int]:
    """Which board is enabled at the end of each epoch."""
    period = moved.scenario.election.period_ticks
    enabled = moved.enabled[period - 1 :: period]
    assert (enabled.sum(axis=1) == 1).all()
    return [int(row.argmax()) for row in enabled]


def switches(moved: Trajectory) -> list[int]:
    """Epochs that ended with another board than the one before."""
    won = winners(moved)
    return [epoch for epoch in range(1, len(won)) if won[epoch] != won[epoch - 1]]


def test_hysteresis_switches_only_to_a_board_that_is_worse_by_the_margin() -> None:
    """Never sooner, and then at once; what each board claims is on the wire at round 0."""
    moved = run("hysteresis")
    period = moved.scenario.election.period_ticks
    won = winners(moved)
    for epoch in range(1, len(won)):
        claims = moved.urgency[epoch * period]
        mover = won[epoch - 1]
        own = claims.copy()
        own[mover] -= MARGIN
        worse = [board for board in range(3) if own[board] > own[mover] + MARGIN]
        assert (won[epoch] != mover) == bool(worse), epoch
    assert 0 < len(switches(moved)) < len(switches(run("paper")))


def test_with_hysteresis_there_is_one_winner_as_before() -> None:
    moved = run("hysteresis")
    assert moved.ending == "complete"
    agreed = elections(moved)
    assert agreed is not None
    assert (agreed.enabled_1, agreed.enabled_0, agreed.enabled_2_or_more) == (100, 0, 0)
    assert agreed.rounds_to_agreement["never"] == 0


@pytest.mark.parametrize("mover", [0, 1, 2])
@pytest.mark.parametrize("rival", [0, 1, 2])
def test_who_moves_is_overtaken_from_the_margin_on(mover: int, rival: int) -> None:
    """Not by a board that is worse by a little less, and by one that is worse by a little more."""
    for more, wins in ((0.99 * MARGIN, mover), (1.01 * MARGIN, rival)):
        urgencies = [0.1 + more * (board == rival) for board in range(3)]
        boards = [
            Election(ElectionConfig(10, 2, keeps_last=False), Hysteresis(config(i)), board=i)
            for i in range(3)
        ]
        for board, one in enumerate(boards):
            one.enabled = board == mover
        said: list[Gossip] = []
        for tick in range(3):
            for board, one in enumerate(boards):
                heard = (
                    [HeardGossip(0, said[near]) for near in neighbours(board, 3)] if said else []
                )
                one.tick(tick, urgencies[board], heard, [])
            said = [one.gossip for one in boards]
        assert [one.enabled for one in boards] == [board == wins for board in range(3)]


def test_computed_torque_brings_the_trunk_up_without_going_past() -> None:
    """The hip's two poles are real and alike: 40 / s^2 and 12 / s are close to critical damping."""
    moved = run("computed-torque")
    assert moved.ending == "complete"
    trunk = all_indices(moved)["TS"]
    assert trunk.overshoot_deg is not None
    assert trunk.overshoot_deg < 0.1
    assert trunk.rise_90_s is not None
    assert trunk.rise_90_s < 1.0
    assert max(abs(degrees(rad)) for rad in moved.orientations_rad[-1]) < 0.1
