"""The servo: the paper's equation for tau, its limit, and an integral that does not wind up."""

from dataclasses import replace
from math import cos, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from module_agent.firmware.body_view import AngleAndRate, BodySample
from module_agent.firmware.controller import ServoInput
from module_agent.firmware.kinematics import CarriedMass
from module_agent.firmware.servo import Servo, SlewingServo, servo
from protocol.robot.hardware import ServoGains
from protocol.robot.sensors import Readings
from protocol.robot.states import State
from protocol.wire.frames import Observation
from tests.module_agent.robot import config

LAW = settings(max_examples=200, deadline=None, derandomize=True)
GAINS = ServoGains(
    kp_nm_rad=400.0,
    kd_nm_s_rad=100.0,
    ki_nm_rad_s=80.0,
    g_servo=0.7,
    gravity_weight=0.8,
    torque_limit_nm=1e9,
)
TICK_S = 0.001
SMALL = st.floats(-1.0, 1.0, allow_subnormal=False)
INPUTS = st.lists(st.tuples(SMALL, SMALL, SMALL), min_size=1, max_size=20)


def _servo(gains: ServoGains) -> Servo:
    return Servo(config(0, gains, tick_s=TICK_S))


def _seen(error_rad: float, rate_rad_s: float = 0.0, com_sway_rad: float = 0.0) -> ServoInput:
    turn = AngleAndRate(error_rad, rate_rad_s)
    carried = CarriedMass(1.0, sin(com_sway_rad), cos(com_sway_rad), 0.0, 0.0)
    sensors = Observation(1, 1, 0, Readings(*(0.0,) * 7), b"", ())
    body = BodySample(turn, turn, carried)
    return ServoInput(0, True, 0.0, error_rad, rate_rad_s, turn, body, State.RUNNING, sensors)


def _torques(gains: ServoGains, inputs: list[tuple[float, float, float]]) -> list[float]:
    servo = _servo(gains)
    return [servo.torque_nm(_seen(*one)) for one in inputs]


@LAW
@given(INPUTS)
def test_torque_is_the_equation(inputs: list[tuple[float, float, float]]) -> None:
    """tau = -[G_g alpha_CoM + G_servo (K_p eps + K_d alpha' + K_i integral)], G_g = w K_p.

    The integral takes in the error of a tick before it is used (S10).
    """
    integral = 0.0
    for torque, (error, rate, sway) in zip(_torques(GAINS, inputs), inputs, strict=True):
        integral += error * 0.001
        servo = 400.0 * error + 100.0 * rate + 80.0 * integral
        assert torque == pytest.approx(-(0.8 * 400.0 * sway + 0.7 * servo), rel=1e-12, abs=1e-12)


@LAW
@given(INPUTS, INPUTS, st.floats(-2.0, 2.0))
def test_below_its_limit_the_servo_is_linear(
    first: list[tuple[float, float, float]],
    second: list[tuple[float, float, float]],
    factor: float,
) -> None:
    """Superposition over a whole history: rounding is all that may differ."""
    both = [
        (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])
        for a, b in zip(first, second, strict=False)
    ]
    expected = [
        a + factor * b
        for a, b in zip(_torques(GAINS, first), _torques(GAINS, second), strict=False)
    ]
    assert _torques(GAINS, both) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_each_term_restores() -> None:
    """Positive error, rate or sway is answered by a negative torque."""
    for inputs in ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)):
        assert _torques(GAINS, [inputs])[0] < 0.0
    assert _torques(GAINS, [(0.0, 0.0, 0.0)]) == [0.0]


@LAW
@given(INPUTS, st.floats(0.1, 500.0))
def test_torque_never_passes_its_limit(
    inputs: list[tuple[float, float, float]], limit: float
) -> None:
    limited = structs.replace(GAINS, torque_limit_nm=limit)
    assert all(abs(torque) <= limit for torque in _torques(limited, inputs))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_integral_stands_still_while_saturated_outwards(side: float) -> None:
    servo = _servo(structs.replace(GAINS, torque_limit_nm=10.0))
    for _ in range(1000):
        torque = servo.torque_nm(_seen(side))
        assert torque == -side * 10.0
    assert servo.integral_rad_s == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_integral_moves_inwards_while_saturated(side: float) -> None:
    """The rate alone drives the torque to its limit; the error would bring it back."""
    servo = _servo(structs.replace(GAINS, torque_limit_nm=10.0))
    for tick in range(1, 101):
        torque = servo.torque_nm(_seen(-0.1 * side, 9.0 * side))
        assert torque == -side * 10.0
        assert servo.integral_rad_s == pytest.approx(-0.1 * side * TICK_S * tick)


def test_after_saturation_the_torque_returns_without_delay() -> None:
    """What anti-windup is for: an integral wound up for 10 s would hold the torque at its limit."""
    servo = _servo(structs.replace(GAINS, torque_limit_nm=10.0, kd_nm_s_rad=0.0))
    for _ in range(10_000):
        servo.torque_nm(_seen(1.0))
    after = servo.torque_nm(_seen(-0.01))
    assert after == pytest.approx(0.7 * 400.0 * 0.01, rel=1e-3)


def test_the_integral_survives_a_change_of_goal() -> None:
    """S10: one integrator per board, neither reset nor frozen by switching."""
    servo = _servo(GAINS)
    for error in (0.5, -0.2, 0.0, 0.3):
        servo.torque_nm(_seen(error))
    assert servo.integral_rad_s == pytest.approx(0.6 * TICK_S)


def _slewing(rate: float = 1000.0) -> SlewingServo:
    return SlewingServo(replace(config(0, GAINS, tick_s=TICK_S), torque_rate_nm_s=rate))


def test_a_motor_that_changes_at_once_needs_no_other_servo() -> None:
    at_once = config(0, GAINS, tick_s=TICK_S)
    assert type(servo(at_once)) is Servo
    assert type(servo(replace(at_once, torque_rate_nm_s=1.0))) is SlewingServo


@LAW
@given(inputs=INPUTS, rate=st.floats(100.0, 1e6))
def test_it_asks_for_no_more_than_the_motor_can_do_in_a_tick(
    inputs: list[tuple[float, float, float]], rate: float
) -> None:
    slewing, before = _slewing(rate), 0.0
    for one in inputs:
        asked = slewing.torque_nm(_seen(*one))
        assert abs(asked - before) <= rate * TICK_S * (1.0 + 1e-9)
        before = asked


@LAW
@given(inputs=INPUTS)
def test_with_time_enough_it_is_the_servo(inputs: list[tuple[float, float, float]]) -> None:
    plain, slewing = _servo(GAINS), _slewing(1e9)
    for one in inputs:
        assert slewing.torque_nm(_seen(*one)) == pytest.approx(
            plain.torque_nm(_seen(*one)), abs=1e-9
        )
        assert slewing.integral_rad_s == plain.integral_rad_s


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_integral_stands_still_while_the_motor_is_on_its_way(side: float) -> None:
    """It moves again when the error has turned round."""
    slewing = _slewing()
    for _ in range(50):
        slewing.torque_nm(_seen(side))
    assert slewing.integral_rad_s == 0.0
    slewing.torque_nm(_seen(-0.01 * side, 0.0, side))
    assert slewing.integral_rad_s == pytest.approx(-0.01 * side * TICK_S)
