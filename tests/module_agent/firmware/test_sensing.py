"""A board's own sensors: what is no reading is held for 10 ticks, then they are given up."""

from math import inf, nan

import pytest

from module_agent.firmware.body_view import AngleAndRate, OwnAngles
from module_agent.firmware.plausibility import RAD_MAX, RAD_S_MAX
from module_agent.firmware.sensing import BACK_TICKS, HOLD_TICKS_MAX, Sensing
from protocol.robot.sensors import Readings
from protocol.robot.states import COUNTERS, State
from protocol.wire.frames import LinkFrame, Observation, decode, encode
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    PROPORTIONAL,
    ROUNDS,
    Robot,
    board,
    link,
    moving,
    observation,
    still,
    torque,
)

JOINT = {"joint_rad", "joint_rad_s"}
LIES = [
    (field, value)
    for field in ("joint_rad", "joint_rad_s", "imu_rad", "imu_rad_s")
    for value in (nan, inf, -inf, 1e4, -1e4, 1e300)
]


def seen(tick: int, **changes: float) -> Observation:
    return lying(decode(Observation, observation(2, tick)), **changes)


def lying(true: Observation, **changes: float) -> Observation:
    return true._replace(readings=true.readings._replace(**changes))


def hip() -> Sensing:
    return Sensing(tick_s=1e-3, has_imu=True)


def good(tick: int) -> OwnAngles:
    true = moving(2, tick)
    return OwnAngles(
        AngleAndRate(true.joint_rad, true.joint_rad_s), AngleAndRate(true.imu_rad, true.imu_rad_s)
    )


@pytest.mark.parametrize(("field", "value"), LIES)
def test_what_no_body_can_have_is_never_used(field: str, value: float) -> None:
    sensing = hip()
    assert sensing.read(seen(5)) == good(5)
    assert sensing.read(seen(6, **{field: value})) == good(5)
    assert sensing.implausible_samples + sensing.inconsistent_samples == 1
    assert sensing.read(seen(7)) == good(7)
    assert sensing.safe


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_largest_plausible_readings_are_used(sign: float) -> None:
    for field, most in (("joint_rad", RAD_MAX), ("imu_rad_s", RAD_S_MAX)):
        sensing = hip()
        sensing.read(seen(5, **{field: sign * most}))
        assert sensing.implausible_samples == 0
        sensing = hip()
        sensing.read(seen(5, **{field: sign * 1.0001 * most}))
        assert sensing.implausible_samples == 1


def test_it_is_safe_to_drive_for_ten_ticks_on_what_is_held_and_no_longer() -> None:
    sensing = hip()
    sensing.read(seen(0))
    safe = []
    for tick in range(1, 30):
        assert sensing.read(seen(tick, joint_rad=nan)) == good(0)
        safe.append(sensing.safe)
    assert safe == [True] * HOLD_TICKS_MAX + [False] * (29 - HOLD_TICKS_MAX)
    assert sensing.implausible_samples == 29


def test_sensors_that_were_given_up_are_back_after_readings_in_a_row_that_agree() -> None:
    sensing = hip()
    for tick in range(20):
        sensing.read(seen(tick, **({} if tick == 0 else {"joint_rad": nan})))
    assert not sensing.safe
    for tick in range(20, 20 + BACK_TICKS - 1):
        assert sensing.read(seen(tick)) == good(0), "what has not proved itself is not used"
    sensing.read(seen(20 + BACK_TICKS - 1, imu_rad=nan))
    first = 20 + BACK_TICKS
    for tick in range(first, first + BACK_TICKS):
        assert not sensing.safe
        sensing.read(seen(tick))
    assert sensing.safe
    assert sensing.read(seen(first + BACK_TICKS)) == good(first + BACK_TICKS)


def test_gaps_count_one_by_one() -> None:
    """Ten bad, one good, ten bad again: never unsafe."""
    sensing = hip()
    for tick in range(100):
        sensing.read(seen(tick, **({} if tick % 11 == 0 else {"imu_rad": inf})))
        assert sensing.safe
    assert sensing.implausible_samples == 90


FAILS, BACK = 2 * PERIOD_TICKS + 10, 3 * PERIOD_TICKS + 10


def _fails(index: int, tick: int) -> Readings:
    """The hip is most urgent, so it is enabled; then its joint sensor breaks for one epoch."""
    sensed = still(index, tick)
    broken = index == 2 and FAILS <= tick < BACK
    return sensed._replace(joint_rad=nan) if broken else sensed


@pytest.mark.parametrize("lie_rad", [3.0, -90.0])
def test_a_board_whose_first_reading_was_a_lie_is_back_as_soon_as_any_other(lie_rad: float) -> None:
    """It has nothing to compare it with. But what it gives up counts no more, however far off."""
    sensing = hip()
    sensing.read(seen(0, joint_rad=lie_rad))
    ticks = HOLD_TICKS_MAX + 1 + BACK_TICKS
    usable = [sensing.read(seen(tick)) == good(tick) for tick in range(1, ticks + 2)]
    assert usable == [False] * ticks + [True]


def test_a_board_without_sensors_lets_go_and_is_elected_again_when_they_are_back() -> None:
    """The others elect one of themselves meanwhile, from the next epoch on. The board drives again
    when its sensors have proved themselves and its delay line is full again."""
    acts = Robot(gains=PROPORTIONAL, sensors=_fails).run(6 * PERIOD_TICKS)
    unsafe = range(FAILS + HOLD_TICKS_MAX, BACK + BACK_TICKS - 1 + DELAY_TICKS)
    for tick in range(6 * PERIOD_TICKS):
        said = torque(acts[tick][2])
        assert (said.state == State.SAFE) == (tick in unsafe)
        if tick in unsafe:
            assert (said.torque_nm, said.enabled) == (0.0, 0)
    hip = [torque(acts[tick][2]).enabled for tick in range(6 * PERIOD_TICKS)]
    latch = 5 * PERIOD_TICKS + ROUNDS
    assert hip[ROUNDS : unsafe.start] == [1] * (unsafe.start - ROUNDS)
    assert hip[unsafe.start : latch] == [0] * (latch - unsafe.start)
    assert hip[latch:] == [1] * (6 * PERIOD_TICKS - latch)
    for tick in range(3 * PERIOD_TICKS + ROUNDS, latch):
        assert sum(torque(act).enabled for act in acts[tick][:2]) == 1


def test_nothing_that_is_no_number_leaves_the_board() -> None:
    """Whatever its sensors say: its torque, its urgency and what it tells its neighbours."""
    for acts in Robot(sensors=_fails).run(4 * PERIOD_TICKS).values():
        for act in acts:
            assert abs(torque(act).torque_nm) < 1e6
            for place in range(len(act.links)):
                assert all(abs(x) < 1e6 for x in link(act, place) if isinstance(x, float))


def test_implausible_samples_are_told_to_the_plant() -> None:
    hip, counted = board(2), {}
    for tick in range(-DELAY_TICKS, 30):
        payload = observation(2, tick, waits=0)
        if 0 <= tick < 4:
            payload = encode(lying(decode(Observation, payload), imu_rad=nan))
        said = torque(hip.tick(hip.read(payload)))
        assert said.counter == tick % len(COUNTERS)
        counted[COUNTERS[said.counter]] = said.counted
    assert set(counted) == set(COUNTERS), "each counter in turn"
    assert counted["implausible_samples"] == 4
    assert counted["refused_corrupt"] == 0


@pytest.mark.parametrize("sensor", ["imu_rad", "imu_rad_s", "foot_force_n", "foot_cop_m"])
def test_a_first_sample_that_is_no_number_does_not_spread(sensor: str) -> None:
    """Level and still stands in for it."""
    hip, changes = board(2), {sensor: nan}
    first = seen(-DELAY_TICKS, **changes)
    said = decode(LinkFrame, hip.tick(hip.read(encode(first))).links[0])
    assert all(abs(x) < 1e6 for x in said if isinstance(x, float))
