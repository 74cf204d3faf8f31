"""The table of sensors: readings, names, and which faults they can have."""

from math import inf, nan
from typing import get_args

import pytest
from msgspec.structs import replace

from protocol.robot.chance import GARBAGE, INTERMITTENT, JITTER, PHASE, START_UP
from protocol.robot.sensors import (
    EXACT,
    FAULTABLE,
    FAULTS,
    FULL_SCALES,
    MEANINGS,
    PLACES,
    READINGS,
    SENSORS,
    FaultKind,
    Readings,
    SensorSheet,
    amount_trouble,
    noises,
    sensors_of,
)


def test_every_reading_is_made_by_one_sensor_and_every_sensor_makes_one() -> None:
    assert sorted(place for places in PLACES.values() for place in places) == [
        *range(len(Readings._fields))
    ]
    assert all(PLACES[sensor] for sensor in SENSORS)
    assert (*SENSORS, "all") == FAULTABLE


def test_the_table_says_all_of_every_reading() -> None:
    assert tuple(READINGS) == tuple(MEANINGS) == Readings._fields
    assert all(MEANINGS.values())
    assert len(FULL_SCALES) == len(Readings._fields)
    assert all(full_scale > 0.0 for full_scale in FULL_SCALES)


def test_no_noise_is_drawn_for_what_something_else_is_drawn_for() -> None:
    taken = [reading.noise.purpose for reading in READINGS.values() if reading.noise is not None]
    taken += [PHASE, JITTER, START_UP, INTERMITTENT]
    assert len(set(taken)) == len(taken)
    assert max(taken) < GARBAGE


def test_noise_is_as_dense_as_the_data_sheet_says() -> None:
    assert noises(EXACT) == []
    for field, reading in READINGS.items():
        if reading.noise is not None:
            noisy = replace(EXACT, **{reading.noise.density: 0.5})
            assert noises(noisy) == [(field, 0.5, reading.noise.purpose)]


def test_a_board_has_the_sensors_of_its_equipment() -> None:
    bare = sensors_of(SensorSheet(differentiates=True), imu=False, force_plate=False)
    assert bare == ("encoder", "torque")
    whole = sensors_of(EXACT, imu=True, force_plate=True)
    assert whole == SENSORS


@pytest.mark.parametrize("fault", get_args(FaultKind))
def test_no_fault_takes_what_is_no_number(fault: FaultKind) -> None:
    assert fault in FAULTS
    for amount in (nan, inf, -1.0):
        assert amount_trouble(fault, amount) is not None
    good = {"slow": 20.0, "delayed": 1.0, "intermittent": 0.5}
    assert amount_trouble(fault, good.get(fault, 0.0)) is None
