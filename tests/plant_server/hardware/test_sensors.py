"""Sensors that have steps, bias, noise and a clock of their own: what they make of the truth."""

from itertools import pairwise
from math import exp, isnan, nan, sqrt

import pytest
from msgspec.structs import replace

from plant_server.hardware.sensors import Differentiator, Instruments
from protocol.robot.chance import Chance
from protocol.robot.clocks import Clock
from protocol.robot.events import SensorFault
from protocol.robot.hardware import STEADY, ClockSheet
from protocol.robot.sensors import EXACT, Readings, SensorSheet
from protocol.wire.frames import Observation, decode
from tests.plant_server.plant import ANKLE, HIP, KNEE, finish, opened, plant, play

TICK_S = 1e-3
TRUTH = Readings(0.1234567, 0.5, 3.0, -0.2345678, 0.25, 490.0, 0.01)
BITS_14 = 2.0 * 3.141592653589793 / 2**14


def instruments(
    sheet: SensorSheet, clock_sheet: ClockSheet = STEADY, *, seed: int = 1, board: int = HIP
) -> Instruments:
    clock = Clock(clock_sheet, seed=seed, board=board, tick_s=TICK_S)
    return Instruments(sheet, clock, Chance(seed=seed, board=board), tick_s=TICK_S)


def measured(sheet: SensorSheet, ticks: int, truth: Readings = TRUTH) -> list[Readings]:
    one = instruments(sheet)
    return [one.measure(tick, truth, imu=True) for tick in range(ticks)]


def test_exact_sensors_say_the_bodys_own_numbers() -> None:
    lockstep = plant()
    for _ in range(5):
        play(lockstep, 1.0, -2.0, 3.0)
    told = opened(lockstep)
    body = lockstep.plant.body
    for board in (ANKLE, KNEE, HIP):
        assert told[board].readings.joint_rad == body.angles_rad[board]
        assert told[board].readings.joint_rad_s == body.rates_rad_s[board]
        assert told[board].readings.joint_torque_nm == body.torques_nm[board]
    assert (
        told[HIP].readings.imu_rad == body.angles_rad[0] + body.angles_rad[1] + body.angles_rad[2]
    )
    assert (told[KNEE].readings.imu_rad, told[KNEE].readings.foot_force_n) == (0.0, 0.0)
    assert told[ANKLE].readings.foot_force_n == body.foot_force_n


@pytest.mark.parametrize("step_rad", [BITS_14, 0.01, 0.39])
def test_an_encoder_is_off_by_half_a_step_at_most(step_rad: float) -> None:
    one = instruments(SensorSheet(encoder_step_rad=step_rad))
    errors = []
    for i in range(-2000, 2000):
        true_rad = i * 0.00177
        said_rad = one.measure(0, TRUTH._replace(joint_rad=true_rad), imu=False).joint_rad
        assert said_rad / step_rad == pytest.approx(round(said_rad / step_rad), abs=1e-9)
        errors.append(abs(said_rad - true_rad))
    assert 0.49 * step_rad < max(errors) <= 0.5 * step_rad * (1.0 + 1e-12)


def test_offset_and_bias_are_added() -> None:
    sheet = SensorSheet(encoder_offset_rad=0.01, imu_bias_rad=-0.02, imu_rate_bias_rad_s=0.03)
    (said,) = measured(sheet, 1)
    assert said.joint_rad == TRUTH.joint_rad + 0.01
    assert said.imu_rad == TRUTH.imu_rad - 0.02
    assert said.imu_rad_s == TRUTH.imu_rad_s + 0.03
    assert said.joint_rad_s == TRUTH.joint_rad_s
    assert said.joint_torque_nm == TRUTH.joint_torque_nm
    assert said[5:] == TRUTH[5:]


@pytest.mark.parametrize(
    ("key", "field"),
    [
        ("joint_rate_noise_rad_s_per_sqrt_hz", "joint_rad_s"),
        ("imu_noise_rad_per_sqrt_hz", "imu_rad"),
        ("imu_rate_noise_rad_s_per_sqrt_hz", "imu_rad_s"),
    ],
)
def test_the_variance_of_noise_is_its_density_squared_over_a_tick(key: str, field: str) -> None:
    """Summed up over t: a random walk of density x sqrt(t). White: within four standard errors."""
    density, n = 2e-4, 20_000
    said = measured(replace(EXACT, **{key: density}), n)
    noise = [getattr(one, field) - getattr(TRUTH, field) for one in said]
    variance = sum(x * x for x in noise) / n
    assert abs(variance / (density**2 / TICK_S) - 1.0) < 4.0 * sqrt(2.0 / n)
    neighbours = sum(a * b for a, b in pairwise(noise)) / n
    assert abs(neighbours) < 4.0 * variance / sqrt(n)
    for other in set(Readings._fields) - {field}:
        assert {getattr(one, other) for one in said} == {getattr(TRUTH, other)}


def test_noise_is_that_of_the_time_between_two_readings() -> None:
    """A board that reads at a quarter of the rate averages over four ticks."""
    sheet, n = SensorSheet(imu_noise_rad_per_sqrt_hz=2e-4), 20_000
    chance = Chance(seed=1, board=HIP)
    one = Instruments(
        sheet,
        Clock(STEADY, seed=1, board=HIP, tick_s=TICK_S),
        chance,
        tick_s=TICK_S,
        every_ticks=4,
    )
    noise = [one.measure(4 * k, TRUTH, imu=True).imu_rad - TRUTH.imu_rad for k in range(n)]
    variance = sum(x * x for x in noise) / n
    assert abs(variance / (4e-8 / (4.0 * TICK_S)) - 1.0) < 4.0 * sqrt(2.0 / n)


def test_a_board_without_an_imu_gets_no_noise_in_its_place() -> None:
    sheet = SensorSheet(imu_noise_rad_per_sqrt_hz=1.0, imu_bias_rad=1.0)
    said = instruments(sheet).measure(0, TRUTH._replace(imu_rad=0.0, imu_rad_s=0.0), imu=False)
    assert (said.imu_rad, said.imu_rad_s) == (0.0, 0.0)


def test_readings_are_as_old_as_the_boards_clock_makes_them() -> None:
    clock = Clock(ClockSheet(jitter_s=4e-4), seed=1, board=HIP, tick_s=TICK_S)
    one = instruments(SensorSheet(), ClockSheet(jitter_s=4e-4))
    for tick in range(200):
        age_s = clock.age_ticks(tick) * TICK_S
        said = one.measure(tick, TRUTH, imu=True)
        assert said.joint_rad == pytest.approx(TRUTH.joint_rad - 0.5 * age_s, abs=1e-15)
        assert said.imu_rad == pytest.approx(TRUTH.imu_rad - 0.25 * age_s, abs=1e-15)


def test_a_rate_by_difference_is_that_of_a_steady_turn() -> None:
    rate = Differentiator(tick_s=TICK_S, filter_s=0.0)
    assert rate.rate_rad_s(0, 0.3) == 0.0
    for tick in range(1, 100):
        assert rate.rate_rad_s(tick, 0.3 + 0.002 * tick) == pytest.approx(2.0)


def test_behind_a_low_pass_the_rate_follows_as_an_exponential() -> None:
    filter_s = 0.02
    rate = Differentiator(tick_s=TICK_S, filter_s=filter_s)
    rate.rate_rad_s(0, 0.0)
    for tick in range(1, 200):
        expected = 2.0 * (1.0 - exp(-tick * TICK_S / filter_s))
        assert rate.rate_rad_s(tick, 0.002 * tick) == pytest.approx(expected)


def test_a_gap_in_the_angle_is_bridged_and_nothing_that_is_no_number_stays() -> None:
    rate = Differentiator(tick_s=TICK_S, filter_s=0.0)
    rate.rate_rad_s(0, 0.0)
    assert isnan(rate.rate_rad_s(1, nan))
    assert isnan(rate.rate_rad_s(2, nan))
    assert rate.rate_rad_s(3, 0.006) == pytest.approx(2.0)


def test_the_difference_of_steps_is_whole_steps_a_tick() -> None:
    """And a broken encoder breaks the rate that is made from it."""
    sheet = SensorSheet(encoder_step_rad=0.01, differentiates=True)
    lockstep = plant(
        sensor_sheets=(sheet,) * 3,
        clock_sheets=(STEADY,) * 3,
        events=[(50, SensorFault(KNEE, "encoder", "stuck", 0.0, 0))],
    )
    told: list[Observation] = []
    for _ in range(100):
        told.append(opened(lockstep)[KNEE])
        finish(lockstep)
    for before, now in pairwise(told):
        steps = now.readings.joint_rad_s * TICK_S / 0.01
        assert steps == pytest.approx(round(steps), abs=1e-9)
        assert now.readings.joint_rad_s == pytest.approx(
            (now.readings.joint_rad - before.readings.joint_rad) / TICK_S
        )
    assert {one.readings.joint_rad_s for one in told[51:]} == {0.0}
    assert len({one.readings.joint_rad for one in told[:50]}) > 1
    assert len({one.readings.joint_rad for one in told[50:]}) == 1


def test_noise_is_the_same_for_the_same_seed_and_another_for_another() -> None:
    sheet = SensorSheet(imu_noise_rad_per_sqrt_hz=1e-3)

    def run(seed: int) -> list[float]:
        lockstep = plant(sensor_sheets=(sheet,) * 3, clock_sheets=(STEADY,) * 3, seed=seed)
        told = []
        for _ in range(20):
            told.append(opened(lockstep)[HIP].readings.imu_rad)
            finish(lockstep)
        return told

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_an_observation_that_is_said_again_says_the_same() -> None:
    """Noise is drawn once in a tick, however often a board has to be told."""
    sheet = SensorSheet(imu_noise_rad_per_sqrt_hz=1e-3, encoder_step_rad=0.01, differentiates=True)
    lockstep = plant(sensor_sheets=(sheet,) * 3, clock_sheets=(STEADY,) * 3)
    play(lockstep)
    told = opened(lockstep)
    assert decode(Observation, lockstep.observation(HIP)) == told[HIP]
    assert (
        decode(Observation, lockstep.excuse(KNEE, HIP)).readings.imu_rad
        == told[HIP].readings.imu_rad
    )


def test_another_board_begins_without_a_rate() -> None:
    sheet = SensorSheet(encoder_step_rad=1e-4, differentiates=True)
    lockstep = plant(sensor_sheets=(sheet,) * 3, clock_sheets=(STEADY,) * 3)
    for _ in range(50):
        play(lockstep)
    assert opened(lockstep)[KNEE].readings.joint_rad_s != 0.0
    finish(lockstep)
    lockstep.remove(KNEE, "died")
    for _ in range(50):
        play(lockstep)
    lockstep.plant.admit(KNEE, 2)
    assert opened(lockstep)[KNEE].readings.joint_rad_s == 0.0
