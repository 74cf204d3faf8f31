"""Readings that a sensor that works cannot have made; and that one that works is not accused."""

from collections.abc import Callable
from math import cos, inf, nan, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.plausibility import (
    FINE,
    RAD_MAX,
    RAD_S_MAX,
    STUCK_RAD,
    STUCK_TICKS,
    WINDOW_TICKS,
    Angle,
    AngleSheet,
    ReadingVerdict,
)
from protocol.robot.chance import Chance

TICK_S = 1e-3
LAW = settings(max_examples=60, deadline=None, derandomize=True)
EXACT = AngleSheet()
STEP_14_BITS_RAD = 2.0 * 3.14159265 / 2**14
Motion = Callable[[int], tuple[float, float]]


def swing(amplitude_rad: float = 0.3, rad_s: float = 6.0) -> Motion:
    """An angle and its rate, tick by tick."""

    def at(tick: int) -> tuple[float, float]:
        phase = rad_s * tick * TICK_S
        return amplitude_rad * sin(phase), amplitude_rad * rad_s * cos(phase)

    return at


def still(_tick: int) -> tuple[float, float]:
    return 0.2, 0.0


def verdicts(
    motion: Motion,
    ticks: int,
    sheet: AngleSheet = EXACT,
    witness: Callable[[int], float] = float,
) -> list[ReadingVerdict]:
    angle = Angle(sheet, tick_s=TICK_S)
    return [angle.judge(tick, *motion(tick), witness(tick)) for tick in range(ticks)]


def broken(motion: Motion, since: int, until: int, lie: Motion) -> Motion:
    return lambda tick: lie(tick) if since <= tick < until else motion(tick)


@LAW
@given(amplitude=st.floats(0.01, 1.5), rad_s=st.floats(0.1, 25.0))
def test_an_exact_sensor_is_not_accused_of_any_motion(amplitude: float, rad_s: float) -> None:
    assert set(verdicts(swing(amplitude, rad_s), 500)) == {FINE}


@pytest.mark.parametrize("wobble_nm", [0.0, 1e-9])
def test_a_body_that_stands_still_to_the_bit_is_no_witness(wobble_nm: float) -> None:
    """For however long; a torque that changes in its last digits says nothing either."""
    found = verdicts(still, 3000, witness=lambda tick: 5.0 + wobble_nm * (tick % 7))
    assert set(found) == {FINE}


def test_a_brake_that_stops_a_joint_at_once_is_no_lie() -> None:
    """The rate falls to nothing somewhere within a tick; the angle has gone on until then."""

    def stopped(tick: int) -> tuple[float, float]:
        return (0.008 * tick, 8.0) if tick < 100 else (0.008 * 99 + 0.003, 0.0)

    assert set(verdicts(stopped, 300, witness=lambda _: 0.0)) == {FINE}


@pytest.mark.parametrize("step_rad", [STEP_14_BITS_RAD, 0.01, 0.1])
@pytest.mark.parametrize("rad_s", [0.01, 0.3, 6.0])
def test_an_encoder_with_steps_is_not_accused(step_rad: float, rad_s: float) -> None:
    motion = swing(0.5, rad_s)

    def seen(tick: int) -> tuple[float, float]:
        rad, rate = motion(tick)
        return step_rad * round(rad / step_rad), rate

    assert set(verdicts(seen, 4000, AngleSheet(step_rad=step_rad))) == {FINE}


@pytest.mark.parametrize("step_rad", [STEP_14_BITS_RAD, 0.01])
@pytest.mark.parametrize("filter_ticks", [1, 10])
def test_nor_is_one_whose_rate_is_its_own_difference(step_rad: float, filter_ticks: int) -> None:
    """Moving fast and stopping, the filtered rate outlasts the motion."""
    last_rad, rate_rad_s = 0.0, 0.0
    seen = []
    for tick in range(3000):
        rad = 0.4 * sin(3.0 * min(tick, 700) * TICK_S)
        rad = step_rad * round(rad / step_rad)
        rate_rad_s += ((rad - last_rad) / TICK_S - rate_rad_s) / filter_ticks
        last_rad = rad
        seen.append((rad, rate_rad_s))
    sheet = AngleSheet(step_rad=step_rad, own_rate=False)
    assert set(verdicts(seen.__getitem__, 3000, sheet)) == {FINE}


@pytest.mark.parametrize("motion", [swing(), still], ids=["moving", "standing"])
@pytest.mark.parametrize("seed", range(4))
def test_noise_and_bias_of_the_data_sheet_are_not_accused(seed: int, motion: Motion) -> None:
    sheet = AngleSheet(
        noise_rad_per_sqrt_hz=1e-4, rate_noise_rad_s_per_sqrt_hz=2e-4, rate_bias_rad_s=0.01
    )
    chance, per_tick = Chance(seed=seed, board=0), TICK_S**-0.5

    def seen(tick: int) -> tuple[float, float]:
        rad, rate = motion(tick)
        noise_rad = 1e-4 * per_tick * chance.normal(tick, 0)
        noise_rad_s = 2e-4 * per_tick * chance.normal(tick, 1)
        return rad + noise_rad, rate + 0.01 + noise_rad_s

    assert set(verdicts(seen, 5000, sheet)) == {FINE}


def test_readings_at_uneven_times_are_not_accused() -> None:
    chance = Chance(seed=3, board=0)
    motion = swing(1.0, 8.0)

    def seen(tick: int) -> tuple[float, float]:
        rad, rate = motion(tick)
        return rad - rate * TICK_S * 1.9 * chance.uniform(tick, 0), rate

    assert set(verdicts(seen, 3000, AngleSheet(uneven=True))) == {FINE}


@pytest.mark.parametrize("lie", [nan, inf, -inf, 1e9, -1e300, 1.001 * RAD_MAX])
def test_an_angle_that_is_nonsense_is_called_so(lie: float) -> None:
    found = verdicts(broken(swing(), 100, 110, lambda _: (lie, 0.0)), 200)
    assert set(found[100:110]) == {ReadingVerdict.NONSENSE}
    assert {*found[:100], *found[110:]} == {FINE}


@pytest.mark.parametrize("lie", [nan, inf, -inf, 1e9, -1e300, 1.001 * RAD_S_MAX])
def test_a_rate_that_is_nonsense_is_called_so(lie: float) -> None:
    found = verdicts(broken(swing(), 100, 110, lambda tick: (swing()(tick)[0], lie)), 200)
    assert set(found[100:110]) == {ReadingVerdict.NONSENSE}
    assert {*found[:100], *found[110:]} == {FINE}


def test_the_largest_numbers_that_make_sense() -> None:
    assert verdicts(lambda _: (RAD_MAX, RAD_S_MAX), 1) == [FINE]
    assert verdicts(lambda _: (RAD_MAX, 1.001 * RAD_S_MAX), 1) == [ReadingVerdict.NONSENSE]


@pytest.mark.parametrize("jump_rad", [0.01, -0.05, 0.5, -3.0])
def test_a_jump_is_noticed_at_once_and_forgotten_when_it_was_a_glitch(jump_rad: float) -> None:
    motion = swing()

    def glitch(tick: int) -> tuple[float, float]:
        rad, rate = motion(tick)
        return rad + jump_rad, rate

    found = verdicts(broken(motion, 300, 301, glitch), 600)
    assert found[300] is ReadingVerdict.INCONSISTENT
    assert {*found[:300], *found[302:]} == {FINE}


def test_an_encoder_that_has_slipped_is_in_doubt_until_it_is_judged_anew() -> None:
    motion = swing()

    def slipped(tick: int) -> tuple[float, float]:
        rad, rate = motion(tick)
        return (rad + 0.1 if tick >= 300 else rad), rate

    assert set(verdicts(slipped, 320)[300:]) == {ReadingVerdict.INCONSISTENT}
    angle = Angle(EXACT, tick_s=TICK_S)
    for tick in range(320):
        angle.judge(tick, *slipped(tick), 0.0)
    angle.restart()
    assert {angle.judge(tick, *slipped(tick), 0.0) for tick in range(320, 600)} == {FINE}


@pytest.mark.parametrize("seed", range(10))
def test_a_rate_that_says_anything_is_noticed_within_some_ticks(seed: int) -> None:
    chance = Chance(seed=seed, board=0)

    def lie(tick: int) -> tuple[float, float]:
        return swing()(tick)[0], 70.0 * (chance.uniform(tick, 0) - 0.5)

    doubts = [verdict is not FINE for verdict in verdicts(broken(swing(), 300, 500, lie), 500)]
    assert not any(doubts[:300])
    assert any(doubts[300:310])
    assert sum(doubts[300:]) > 150


def test_a_rate_that_is_stuck_is_noticed_when_the_angle_has_gone_elsewhere() -> None:
    found = verdicts(broken(swing(), 300, 900, lambda tick: (swing()(tick)[0], 0.4)), 900)
    first = next(tick for tick, verdict in enumerate(found) if verdict is not FINE)
    assert 300 < first < 420


def test_an_angle_that_is_stuck_while_its_rate_goes_on_is_noticed() -> None:
    motion = swing()
    stuck = broken(motion, 400, 700, lambda tick: (motion(400)[0], motion(tick)[1]))
    found = verdicts(stuck, 700)
    turned = next(n for n in range(300) if abs(motion(400 + n)[0] - motion(400)[0]) > STUCK_RAD)
    noticed = next(n for n in range(300) if found[400 + n] is not FINE)
    assert turned <= noticed <= turned + 2
    assert FINE not in found[400 + noticed :]
    assert ReadingVerdict.STUCK in found


def test_all_of_a_sensor_stuck_at_a_rate_is_a_contradiction() -> None:
    """The rate says for ever that the joint turns, and the angle that it does not."""
    found = verdicts(lambda _: (0.1, 0.01), 300, witness=lambda _: 0.0)
    ticks = round(STUCK_RAD / (0.01 * TICK_S))
    assert set(found[: ticks - 1]) == {FINE}
    assert found[-1] is not FINE


def test_a_witness_that_changes_accuses_an_angle_that_does_not() -> None:
    """Once the angle has been the same for long enough; and for as long as it stays the same."""

    def torque(tick: int) -> float:
        return 0.05 * min(tick, 100)

    found = verdicts(still, 3 * WINDOW_TICKS, witness=torque)
    first = found.index(ReadingVerdict.STUCK)
    assert STUCK_TICKS <= first <= 40
    assert set(found[first:]) == {ReadingVerdict.STUCK}
    coarse = verdicts(still, 500, AngleSheet(step_rad=1e-3), torque)
    assert set(coarse) == {FINE}, "a sensor with steps may say the same of a joint that moves"
