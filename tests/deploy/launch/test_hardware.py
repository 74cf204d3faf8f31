"""Robots whose parts are not ideal, in the twin: what they still do, to the bit each time."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from deploy.launch.twin import Twin, run_twin
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from module_agent.firmware.sensing import BACK_TICKS, HOLD_TICKS_MAX
from plant_server.session.record import COMPLETE, FELL
from protocol.robot.events import Tipping
from protocol.robot.states import State

pytestmark = pytest.mark.slow

JOINTS = ("ankle", "knee", "hip")
ANKLE, KNEE, HIP = range(3)
DELAY_TICKS = 10


@cache
def run_of(source: str, *settings: str) -> Trajectory:
    scenario = load(source, list(settings))
    return trajectory(scenario, *run_twin(scenario))


def lean_deg(run: Trajectory, since: int = 0) -> float:
    return float(np.degrees(np.abs(run.orientations_rad[since:])).max())


def test_with_delays_as_a_humans_the_body_stands_for_half_a_minute_and_under_a_push() -> None:
    run = run_of("human-delay")
    assert run.ending == COMPLETE
    assert run.ticks == 30_000
    assert lean_deg(run, 15_000) < 4.0, "from the paper's bow to upright"
    assert lean_deg(run, 20_000) > 0.5, "the push at 20 s is felt"
    assert lean_deg(run, 28_000) < 2.0


def test_it_stands_as_well_when_all_boards_move() -> None:
    run = run_of("human-delay", "election.enabled=false", "run.duration_s=12", "event=[]")
    assert run.ending == COMPLETE
    assert lean_deg(run, 10_000) < 2.0


def test_without_the_passive_parts_these_delays_make_it_fall() -> None:
    nothing = [
        f"board.{i}.passive.{key}=0"
        for i in range(3)
        for key in ("stiffness_nm_rad", "damping_nm_s_rad")
    ]
    run = run_of("human-delay", *nothing, "run.duration_s=2", "event=[]")
    assert run.ending == FELL
    assert run.ticks < 1000


def test_on_hardware_the_movement_of_the_paper_is_completed_though_not_as_exactly() -> None:
    run, ideal = run_of("hardware", "run.duration_s=4"), run_of("paper", "run.duration_s=4")
    assert run.ending == COMPLETE
    assert lean_deg(run, 3000) < 3.0
    apart = np.degrees(np.abs(run.orientations_rad - ideal.orientations_rad)).max()
    assert 0.1 < apart < 10.0
    assert set(np.unique(run.state)) <= {State.SYNCING, State.RUNNING, State.HOLDING}


def test_no_sensor_of_the_hardware_is_accused() -> None:
    twin = Twin(load("hardware", ["run.duration_s=3"]))
    for _ in twin.run():
        pass
    for firmware in twin.boards:
        assert firmware is not None
        sensing = firmware.sensing
        counted = sensing.implausible_samples, sensing.inconsistent_samples, sensing.stuck_samples
        assert counted == (0, 0, 0)


def test_the_same_seed_is_the_same_run_and_another_is_another() -> None:
    def digest(seed: int) -> str:
        scenario = load("hardware", ["run.duration_s=0.5", f"run.seed={seed}"])
        return trajectory(scenario, *run_twin(scenario)).state_sha256

    assert digest(1) == digest(1)
    assert digest(1) != digest(2)


@pytest.mark.parametrize(
    "setting",
    [
        "board.1.sensors.encoder_bits=12",
        "board.1.sensors.encoder_offset_deg=1",
        "board.1.sensors.joint_rate=encoder",
        "board.1.sensors.joint_rate_noise_deg_s_per_sqrt_hz=0.1",
        "board.2.sensors.imu_noise_deg_per_sqrt_hz=0.01",
        "board.2.sensors.imu_rate_noise_deg_s_per_sqrt_hz=0.01",
        "board.2.sensors.imu_bias_deg=1",
        "board.2.sensors.imu_rate_bias_deg_s=1",
        "board.1.clock.jitter_ms=0.5",
        "board.1.clock.skew_ppm=-5000",
        "board.1.clock.overrun_at_s=[0.05]",
        "board.1.actuator.torque_rate_nm_s=500",
        "board.1.actuator.torque_step_nm=1",
        "board.1.actuator.lag_ms=5",
        "board.1.passive.stiffness_nm_rad=50",
        "board.1.passive.damping_nm_s_rad=5",
    ],
)
def test_each_part_does_something_by_itself(setting: str) -> None:
    short = "run.duration_s=0.3"
    assert run_of("paper", short, setting).state_sha256 != run_of("paper", short).state_sha256


def faulty(joint: str, sensor: str, fault: str, duration_s: float = 0.2) -> Trajectory:
    event = (
        f"event=[{{at_s=0.3, do='sensor', joint='{joint}', sensor='{sensor}',"
        f" fault='{fault}', duration_s={duration_s}}}]"
    )
    return run_of("paper", "run.duration_s=0.9", event)


def safe_ticks(run: Trajectory, board: int) -> list[int]:
    found: list[int] = np.flatnonzero(run.state[:, board] == State.SAFE).tolist()
    return found


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("fault", ["off", "stuck", "garbage"])
def test_a_sensor_that_fails_is_held_then_given_up_then_back(joint: str, fault: str) -> None:
    """Ten ticks of hold once it is noticed; back when it has agreed with itself for long enough
    and the delay line is full of what it said since."""
    run, board = faulty(joint, "encoder", fault), JOINTS.index(joint)
    safe = safe_ticks(run, board)
    noticed = safe[0] - HOLD_TICKS_MAX - 300
    assert 0 <= noticed <= (15 if fault == "stuck" else 1)
    assert all(b == a + 1 for a, b in pairwise(safe))
    back = safe[-1] + 1 - 500
    assert BACK_TICKS + DELAY_TICKS - 1 <= back <= BACK_TICKS + DELAY_TICKS + 25
    assert (run.torques_nm[safe, board] == 0.0).all()
    assert (run.enabled[safe, board] == 0).all()
    assert State.RUNNING in run.state[safe[-1] + 1 :, board]


@pytest.mark.parametrize("fault", ["off", "garbage"])
def test_a_sensor_that_fails_for_less_than_the_hold_costs_nothing_but_a_hold(fault: str) -> None:
    run = faulty("knee", "encoder", fault, duration_s=0.009)
    assert safe_ticks(run, KNEE) == []
    assert set(run.state[:, KNEE]) == {State.RUNNING}


def test_bad_sensors_one_after_the_other_do_not_make_it_fall() -> None:
    run = run_of("bad-sensors")
    assert run.ending == COMPLETE
    assert {board for board in range(3) if safe_ticks(run, board)} == {ANKLE, KNEE, HIP}
    assert set(run.state[-100:].flatten()) == {State.RUNNING}


def test_a_board_that_takes_a_while_to_start_drives_that_much_later() -> None:
    swap = (
        "event=[{at_s=0.2, do='unplug', joint='hip'}, {at_s=0.3, do='plug', joint='hip'}]",
        "unattended.how=braked",
        "run.duration_s=0.6",
    )

    def drives(run: Trajectory) -> int:
        absent = np.flatnonzero(run.state[:, HIP] <= State.SYNCING)
        return int(absent[-1]) + 1

    at_once = run_of("paper", *swap)
    slowly = run_of("paper", *swap, "board.2.clock.start_up_ms=120")
    assert drives(at_once) == 300 + DELAY_TICKS
    assert drives(slowly) == 300 + 120 + DELAY_TICKS
    assert (slowly.state[300:420, HIP] == 0).all(), "until then it is nobody"


def test_a_short_foot_tips_under_a_push_and_falls_under_a_harder_one() -> None:
    stands = run_of("short-foot")
    assert stands.ending == COMPLETE
    tipping = [tick for tick, event in stands.events if isinstance(event, Tipping)]
    assert len(tipping) >= 2
    assert min(tipping) > 4000
    assert run_of("short-foot", "event.0.force_n=-80.0").ending == FELL
