"""The servo: the paper's equation for tau, its limit, and an integral that does not wind up."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.servo import Servo, ServoGains, SlewingServo, servo

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


def _torques(gains: ServoGains, inputs: list[tuple[float, float, float]]) -> list[float]:
    servo = Servo(gains, tick_s=TICK_S)
    return [
        servo.torque_nm(error_rad=error, rate_rad_s=rate, com_sway_rad=sway)
        for error, rate, sway in inputs
    ]


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
@given(INPUTS, INPUTS, st.floats(-3.0, 3.0))
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
    limited = GAINS._replace(torque_limit_nm=limit)
    assert all(abs(torque) <= limit for torque in _torques(limited, inputs))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_integral_stands_still_while_saturated_outwards(side: float) -> None:
    servo = Servo(GAINS._replace(torque_limit_nm=10.0), tick_s=TICK_S)
    for _ in range(1000):
        torque = servo.torque_nm(error_rad=side, rate_rad_s=0.0, com_sway_rad=0.0)
        assert torque == -side * 10.0
    assert servo.integral_rad_s == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_integral_moves_inwards_while_saturated(side: float) -> None:
    """The rate alone drives the torque to its limit; the error would bring it back."""
    servo = Servo(GAINS._replace(torque_limit_nm=10.0), tick_s=TICK_S)
    for tick in range(1, 101):
        torque = servo.torque_nm(error_rad=-0.1 * side, rate_rad_s=9.0 * side, com_sway_rad=0.0)
        assert torque == -side * 10.0
        assert servo.integral_rad_s == pytest.approx(-0.1 * side * TICK_S * tick)


def test_after_saturation_the_torque_returns_without_delay() -> None:
    """What anti-windup is for: an integral wound up for 10 s would hold the torque at its limit."""
    servo = Servo(GAINS._replace(torque_limit_nm=10.0, kd_nm_s_rad=0.0), tick_s=TICK_S)
    for _ in range(10_000):
        servo.torque_nm(error_rad=1.0, rate_rad_s=0.0, com_sway_rad=0.0)
    after = servo.torque_nm(error_rad=-0.01, rate_rad_s=0.0, com_sway_rad=0.0)
    assert after == pytest.approx(0.7 * 400.0 * 0.01, rel=1e-3)


def test_the_integral_survives_a_change_of_goal() -> None:
    """S10: one integrator per board, neither reset nor frozen by switching."""
    servo = Servo(GAINS, tick_s=TICK_S)
    for error in (0.5, -0.2, 0.0, 0.3):
        servo.torque_nm(error_rad=error, rate_rad_s=0.0, com_sway_rad=0.0)
    assert servo.integral_rad_s == pytest.approx(0.6 * TICK_S)


def _slewing(rate: float = 1000.0) -> SlewingServo:
    return SlewingServo(GAINS, tick_s=TICK_S, torque_rate_nm_s=rate)


def test_a_motor_that_changes_at_once_needs_no_other_servo() -> None:
    assert type(servo(GAINS, tick_s=TICK_S, torque_rate_nm_s=None)) is Servo
    assert type(servo(GAINS, tick_s=TICK_S, torque_rate_nm_s=1.0)) is SlewingServo


@LAW
@given(inputs=INPUTS, rate=st.floats(100.0, 1e6))
def test_it_asks_for_no_more_than_the_motor_can_do_in_a_tick(
    inputs: list[tuple[float, float, float]], rate: float
) -> None:
    slewing, before = _slewing(rate), 0.0
    for error, rate_rad_s, sway in inputs:
        asked = slewing.torque_nm(error_rad=error, rate_rad_s=rate_rad_s, com_sway_rad=sway)
        assert abs(asked - before) <= rate * TICK_S * (1.0 + 1e-9)
        before = asked


@LAW
@given(inputs=INPUTS)
def test_with_time_enough_it_is_the_servo(inputs: list[tuple[float, float, float]]) -> None:
    plain, slewing = Servo(GAINS, tick_s=TICK_S), _slewing(1e9)
    for error, rate_rad_s, sway in inputs:
        told = {"error_rad": error, "rate_rad_s": rate_rad_s, "com_sway_rad": sway}
        assert slewing.torque_nm(**told) == pytest.approx(plain.torque_nm(**told), abs=1e-9)
        assert slewing.integral_rad_s == plain.integral_rad_s


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_integral_stands_still_while_the_motor_is_on_its_way(side: float) -> None:
    """It moves again when the error has turned round."""
    slewing = _slewing()
    for _ in range(50):
        slewing.torque_nm(error_rad=side, rate_rad_s=0.0, com_sway_rad=0.0)
    assert slewing.integral_rad_s == 0.0
    slewing.torque_nm(error_rad=-0.01 * side, rate_rad_s=0.0, com_sway_rad=side)
    assert slewing.integral_rad_s == pytest.approx(-0.01 * side * TICK_S)
