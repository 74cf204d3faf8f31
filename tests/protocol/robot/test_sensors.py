"""What sensors are called, and which faults they can have."""

from math import inf, nan

import pytest

from protocol.robot.sensors import ALL, FAULTS, FIELDS, NAMES, amount_trouble, sensors_of
from protocol.wire.frames import Observation


def test_the_readings_of_all_sensors_are_those_of_an_observation() -> None:
    fields = [field for name in FIELDS for field in FIELDS[name]]
    assert sorted(fields) == list(range(7))
    first = Observation._fields.index("joint_rad")
    assert Observation._fields[first + 7] == "command"
    assert (*FIELDS, ALL) == NAMES


def test_a_board_has_the_sensors_of_its_equipment() -> None:
    bare = sensors_of(imu=False, force_plate=False, differentiates=True)
    assert bare == ("encoder", "torque")
    whole = sensors_of(imu=True, force_plate=True, differentiates=False)
    assert whole == tuple(FIELDS)


@pytest.mark.parametrize("fault", FAULTS)
def test_no_fault_takes_what_is_no_number(fault: str) -> None:
    for amount in (nan, inf, -1.0):
        assert amount_trouble(fault, amount) is not None
    good = {"slow": 20.0, "delayed": 1.0, "intermittent": 0.5}
    assert amount_trouble(fault, good.get(fault, 0.0)) is None
