"""Motors: steps, a rate limit, a lag; and what they do when nobody drives them."""

from math import exp, inf, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_server.hardware.actuators import Motor
from protocol.robot.hardware import MotorSheet
from tests.plant_server.plant import ANKLE, HIP, KNEE, LIMIT_NM, plant, play

TICK_S = 1e-3
LAW = settings(max_examples=100, deadline=None, derandomize=True)
TORQUES = st.lists(st.floats(-200.0, 200.0), min_size=1, max_size=50)


def motor(**sheet: Any) -> Motor:
    return Motor(MotorSheet(**sheet), tick_s=TICK_S)


@pytest.mark.parametrize("lag_s", [5e-4, 2e-3, 0.05])
def test_a_step_through_the_lag_is_an_exponential(lag_s: float) -> None:
    one = motor(lag_s=lag_s)
    for tick in range(1, 200):
        expected = 10.0 * (1.0 - exp(-tick * TICK_S / lag_s))
        assert one.torque_nm(10.0) == pytest.approx(expected, rel=1e-12)


@LAW
@given(asked=TORQUES, rate=st.floats(100.0, 50_000.0))
def test_the_torque_never_changes_faster_than_its_limit_and_gets_there(
    asked: list[float], rate: float
) -> None:
    one, before = motor(torque_rate_nm_s=rate), 0.0
    most = rate * TICK_S
    for wanted in asked:
        given_nm = one.torque_nm(wanted)
        assert abs(given_nm - before) <= most * (1.0 + 1e-9)
        reached = abs(wanted - before) <= most
        assert given_nm == pytest.approx(wanted, abs=1e-9) or not reached
        assert abs(given_nm - wanted) <= max(abs(before - wanted) - most, 0.0) + 1e-9
        before = given_nm


@LAW
@given(asked=TORQUES, step=st.sampled_from([0.05, 0.1, 1.0]))
def test_a_command_is_a_whole_number_of_steps_half_a_step_off_at_most(
    asked: list[float], step: float
) -> None:
    one = motor(torque_step_nm=step)
    for wanted in asked:
        given_nm = one.torque_nm(wanted)
        assert abs(given_nm - wanted) <= 0.5 * step * (1.0 + 1e-9)
        assert given_nm / step == pytest.approx(round(given_nm / step), abs=1e-6)


def test_a_motor_that_was_stopped_begins_at_nothing() -> None:
    one = motor(torque_rate_nm_s=1000.0, lag_s=0.01)
    for _ in range(100):
        one.torque_nm(50.0)
    one.stop()
    again, fresh = one.torque_nm(50.0), motor(torque_rate_nm_s=1000.0, lag_s=0.01).torque_nm(50.0)
    assert again == fresh


def test_the_plant_applies_and_records_what_the_motor_gives() -> None:
    """The limit first, then the motor; ideal ones at the other joints change nothing."""
    slow = MotorSheet(torque_rate_nm_s=5000.0)
    ideal = MotorSheet()
    lockstep = plant(motor_sheets=(slow, ideal, ideal))
    applied = [play(lockstep, 40.0, 40.0, 1e6).torques_nm for _ in range(12)]
    assert [torques[ANKLE] for torques in applied] == [
        pytest.approx(min(5.0 * tick, 40.0)) for tick in range(1, 13)
    ]
    assert {torques[KNEE] for torques in applied} == {40.0}
    assert {torques[HIP] for torques in applied} == {LIMIT_NM}
    assert lockstep.plant.actuators.saturated == 12


@pytest.mark.parametrize("broken", [nan, inf, -inf])
def test_what_is_no_number_never_reaches_a_motor(broken: float) -> None:
    lagging = MotorSheet(lag_s=0.01)
    lockstep = plant(motor_sheets=(lagging,) * 3)
    play(lockstep, 10.0, 10.0, 10.0)
    torques = [play(lockstep, broken, 10.0, 10.0).torques_nm[ANKLE] for _ in range(50)]
    assert all(abs(torque) < 10.0 for torque in torques)
    assert torques[9] > torques[0], "held for ten ticks, so the motor goes on towards it"
    assert torques[-1] < 0.1 * torques[9], "then none"


def test_a_motor_in_the_warm_up_is_off() -> None:
    lockstep = plant(warm_up_ticks=5, motor_sheets=(MotorSheet(torque_rate_nm_s=1000.0),) * 3)
    warm_up = [play(lockstep, 10.0, 10.0, 10.0).torques_nm for _ in range(5)]
    assert set(warm_up) == {(0.0, 0.0, 0.0)}
    assert play(lockstep, 10.0, 10.0, 10.0).torques_nm == (1.0, 1.0, 1.0)


def test_a_board_that_goes_takes_its_torque_along() -> None:
    """Its successor begins at nothing, as its motor does."""
    lockstep = plant(motor_sheets=(MotorSheet(torque_rate_nm_s=1000.0),) * 3)
    for _ in range(8):
        play(lockstep, 10.0, 10.0, 10.0)
    lockstep.remove(KNEE, "died")
    assert play(lockstep, 10.0, 10.0, 10.0).torques_nm[KNEE] == 0.0
    lockstep.plant.admit(KNEE, 2)
    assert play(lockstep, 10.0, 10.0, 10.0).torques_nm[KNEE] == pytest.approx(1.0)
