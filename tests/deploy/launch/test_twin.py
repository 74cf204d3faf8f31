"""The twin: what it plays follows from scenario and seed alone."""

import random
from collections.abc import Sequence

import pytest

from deploy.launch.twin import Twin, run_twin
from deploy.scenario_file.load import load
from plant_server.session.record import FELL, TickRecord
from protocol.robot.scenario import Scenario

pytestmark = pytest.mark.sampling


def short(*settings: str) -> Scenario:
    return load("paper", ["run.duration_s=0.3", *settings])


def tick_in_order(twin: Twin, order: Sequence[int]) -> TickRecord:
    """One tick as processes might play it: a fast board's frames reach a slow one too early."""
    twin.lockstep.plant.begin()
    observations = dict(twin.lockstep.open())
    answers = []
    for index in order:
        board = twin.boards[index]
        assert board is not None
        actuation = board.tick(board.read(observations[index]))
        for receiver, frame in zip(board.config.neighbours, actuation.links, strict=True):
            twin.deliver(index, receiver, frame)
        answers.append((index, actuation.torque))
    for index, torque in reversed(answers):
        twin.lockstep.answer(index, torque)
        twin.lockstep.answer(index, torque)  # Answers are a set: twice is no more than once.
    return twin.lockstep.close()


@pytest.mark.parametrize("elects", ["true", "false"])
def test_the_same_scenario_and_seed_give_the_same_bytes(elects: str) -> None:
    scenario = short(f"election.enabled={elects}")
    (records, outcome), (again, other) = run_twin(scenario), run_twin(scenario)
    assert records == again
    assert outcome._replace(wall_s=0.0) == other._replace(wall_s=0.0)


def test_another_seed_is_another_run_of_the_same_motion() -> None:
    """Without faults there is no chance in it: only the name of the run changes in the frames."""
    (records, _), (others, _) = run_twin(short()), run_twin(short("run.seed=2"))
    assert [record.angles_rad for record in records] == [other.angles_rad for other in others]
    assert all(a.answers != b.answers for a, b in zip(records, others, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_s4_the_order_in_which_boards_tick_does_not_matter(seed: int) -> None:
    scenario, chance = short(), random.Random(seed)
    expected, _ = run_twin(scenario)
    twin = Twin(scenario)
    orders = [chance.sample(range(3), 3) for _ in expected]
    assert [tick_in_order(twin, order) for order in orders] == expected


def test_s8_the_body_stays_in_its_posture_until_tick_0() -> None:
    records, outcome = run_twin(short())
    warm_up = [record for record in records if record.tick < 0]
    assert [record.tick for record in warm_up] == list(range(-10, 0))
    assert {record.angles_rad for record in warm_up} == {records[0].angles_rad}
    assert {record.torques_nm for record in warm_up} == {(0.0, 0.0, 0.0)}
    assert records[10].angles_rad == records[0].angles_rad
    assert records[11].angles_rad != records[0].angles_rad
    assert (outcome.tick, len(records)) == (300, 310)


def test_s21_a_fallen_body_ends_the_run() -> None:
    scenario = load("paper", ["board.0.servo.kp_nm_rad=0"])
    records, outcome = run_twin(scenario)
    assert outcome.ending == FELL
    assert 0 < outcome.tick < scenario.run.ticks
    assert records[-1].tick == outcome.tick - 1
