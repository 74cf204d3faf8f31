"""Own sensors in realtime: what is held is no sensor that is stuck, and a gap is no jump."""

from math import nan

import pytest

from module_agent.firmware.sensing import Sensing
from protocol.wire.frames import Observation, decode
from tests.module_agent.robot import moving, observation

PERIOD = 2
"""In ticks of 1 ms."""


def sensing() -> Sensing:
    return Sensing(tick_s=PERIOD * 1e-3, has_imu=True)


def read(one: Sensing, sampled: int, **changes: float) -> None:
    seen = decode(Observation, observation(2, sampled * PERIOD))
    one.read(seen._replace(tick=sampled, readings=seen.readings._replace(**changes)))


def accused(one: Sensing) -> tuple[int, int, int]:
    return one.implausible_samples, one.inconsistent_samples, one.stuck_samples


@pytest.mark.parametrize("held", [1, 2, 7, 40])
def test_an_observation_that_holds_accuses_nobody(held: int) -> None:
    """Every so many turns one arrives, and the joint turns by 3 rad/s."""
    one = sensing()
    for slot in range(1000):
        read(one, slot - slot % held)
    assert accused(one) == (0, 0, 0)
    assert one.safe


def test_a_gap_that_ends_is_no_jump() -> None:
    one = sensing()
    for slot in [*range(50), *range(90, 140), 141, 143, *range(160, 200)]:
        read(one, slot)
    assert accused(one) == (0, 0, 0)


def test_the_same_reading_does_not_pass_twice_as_new() -> None:
    """What is wrong is counted once, however long the observation holds."""
    one = sensing()
    for slot in range(20):
        read(one, slot)
    for _ in range(20, 30):
        read(one, 20, joint_rad=nan)
    assert accused(one) == (1, 0, 0)
    assert one.safe


def test_a_sensor_that_lies_is_noticed_between_readings_that_follow_each_other() -> None:
    one = sensing()
    for slot in range(20):
        read(one, slot)
    joint_rad = moving(2, 19 * PERIOD)[0]
    for slot in range(20, 60):
        read(one, slot, joint_rad=joint_rad)
    assert sum(accused(one)) > 10
    assert not one.safe
