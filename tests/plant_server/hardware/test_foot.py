"""The foot: how much torque the sole can pass on, and what is recorded of too much."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_server.body.body import Body, Spring
from plant_server.body.chain import Chain
from plant_server.hardware.foot import Foot
from protocol.robot.hardware import FootSheet
from tests.plant_server.plant import ANKLE, LINK, happened, plant, play

SOLE = FootSheet(ahead_m=0.2, behind_m=0.05)
LAW = settings(max_examples=200, deadline=None, derandomize=True)


def body(force_n: float = 300.0, spring: Spring | None = None, angle_rad: float = 0.0) -> Body:
    one = Body(
        Chain([LINK]),
        initial_angles_rad=[angle_rad],
        tick_s=1e-3,
        substeps=1,
        passive=[spring],
    )
    one.foot_force_n = force_n
    return one


@LAW
@given(torque_nm=st.floats(-500.0, 500.0), force_n=st.floats(-100.0, 2000.0))
def test_the_centre_of_pressure_stays_under_the_sole(torque_nm: float, force_n: float) -> None:
    foot = Foot(SOLE)
    passed_nm = foot.pass_on(torque_nm, body(force_n))
    if force_n <= 0.0:
        assert passed_nm == 0.0
        return
    cop_m = -passed_nm / force_n
    assert -SOLE.behind_m - 1e-12 <= cop_m <= SOLE.ahead_m + 1e-12
    assert foot.tipping == (passed_nm != torque_nm)


@LAW
@given(torque_nm=st.floats(-15.0, 14.0))
def test_what_the_sole_can_bear_is_passed_on_to_the_bit(torque_nm: float) -> None:
    foot = Foot(SOLE)
    assert foot.pass_on(torque_nm, body()) == torque_nm
    assert not foot.tipping


def test_the_toes_bear_more_than_the_heel() -> None:
    """Leaning forward takes a torque backwards, and pressure ahead of the ankle."""
    foot = Foot(SOLE)
    assert foot.pass_on(-100.0, body()) == -300.0 * 0.2
    assert foot.pass_on(100.0, body()) == 300.0 * 0.05


def test_a_spring_in_the_ankle_presses_on_the_sole_as_well() -> None:
    """It pulls with 10 N m; the motor may add what is left to the edge."""
    spring = Spring(rest_rad=0.1, stiffness_nm_rad=100.0, damping_nm_s_rad=0.0)
    foot = Foot(SOLE)
    assert foot.pass_on(20.0, body(spring=spring)) == pytest.approx(300.0 * 0.05 - 10.0)
    assert foot.pass_on(-100.0, body(spring=spring)) == pytest.approx(-300.0 * 0.2 - 10.0)


def test_the_plant_records_from_when_to_when_the_foot_tips() -> None:
    lockstep = plant(foot=SOLE)
    weight_n = lockstep.plant.body.foot_force_n
    assert happened(play(lockstep, -1.0, 0.0, 0.0), "tipping") == []
    began = play(lockstep, 50.0, 0.0, 0.0)
    assert happened(began, "tipping") == [[True]]
    assert began.torques_nm[ANKLE] == pytest.approx(0.05 * weight_n, rel=0.5)
    assert began.torques_nm[ANKLE] < 50.0
    assert happened(play(lockstep, 50.0, 0.0, 0.0), "tipping") == []
    assert happened(play(lockstep, -1.0, 0.0, 0.0), "tipping") == [[False]]


def test_without_a_foot_the_ground_takes_any_torque() -> None:
    assert play(plant(), -50.0, 0.0, 0.0).torques_nm[ANKLE] == -50.0


def test_an_ankle_without_a_board_does_not_tip_the_foot() -> None:
    lockstep = plant(foot=SOLE)
    play(lockstep, 50.0, 0.0, 0.0)
    lockstep.remove(ANKLE, "died")
    left = play(lockstep, 0.0, 0.0, 0.0)
    assert happened(left, "tipping") == [[False]]
    assert left.torques_nm[ANKLE] == 0.0
