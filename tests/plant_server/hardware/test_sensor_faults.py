"""Sensors that break: what a board is shown in place of its readings."""

from math import isnan

import pytest

from plant_server.hardware.sensor_faults import SensorFaults
from protocol.robot.chance import Chance
from protocol.robot.events import SensorFault
from protocol.robot.sensors import (
    ALL,
    FAULTS,
    FULL_SCALES,
    OK,
    PLACES,
    SENSORS,
    FaultKind,
    Readings,
    SensorName,
)

START = 100


def truth(tick: int) -> Readings:
    return Readings(*(0.001 * tick + field for field in range(7)))


def faults(seed: int = 1, board: int = 1, has: tuple[SensorName, ...] = SENSORS) -> SensorFaults:
    return SensorFaults(has, Chance(seed=seed, board=board))


def shown(broken: SensorFaults, ticks: range) -> list[Readings]:
    return [broken.apply(tick, truth(tick)) for tick in ticks]


def angles(kind: FaultKind, amount: float = 0.0, ticks: int = 0, seen: int = 300) -> list[float]:
    broken = faults()
    broken.obey(START, SensorFault(1, "encoder", kind, amount, ticks))
    return [values[0] for values in shown(broken, range(START, START + seen))]


def true_angles(ticks: range) -> list[float]:
    return [truth(tick)[0] for tick in ticks]


def test_off_says_nothing() -> None:
    assert all(map(isnan, angles("off")))


def test_stuck_says_for_ever_what_it_said_when_it_broke() -> None:
    assert set(angles("stuck")) == {truth(START)[0]}


def test_slow_says_something_new_every_so_many_ticks() -> None:
    every = 20
    assert angles("slow", every) == [truth(START + tick // every * every)[0] for tick in range(300)]


def test_delayed_stands_still_for_the_delay_and_is_then_late_by_it() -> None:
    late = 30
    expected = [truth(START)[0]] * late + true_angles(range(START, START + 300 - late))
    assert angles("delayed", late) == expected


def test_intermittent_says_the_truth_or_nothing() -> None:
    seen = angles("intermittent", 0.3, seen=4000)
    gone = [isnan(angle) for angle in seen]
    for angle, true_angle in zip(seen, true_angles(range(START, START + 4000)), strict=True):
        assert isnan(angle) or angle == true_angle
    assert abs(sum(gone) / len(gone) - 0.3) < 0.03


def test_garbage_is_anything_that_the_sensor_can_show() -> None:
    broken = faults()
    broken.obey(START, SensorFault(1, ALL, "garbage", 0.0, 0))
    for field, values in enumerate(zip(*shown(broken, range(START, START + 2000)), strict=True)):
        assert all(abs(value) <= FULL_SCALES[field] for value in values)
        assert max(values) > 0.98 * FULL_SCALES[field]
        assert min(values) < -0.98 * FULL_SCALES[field]
        assert len(set(values)) == 2000


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_touches_its_sensor_and_no_other_and_ends(kind: FaultKind) -> None:
    amount = {"slow": 5.0, "delayed": 5.0, "intermittent": 1.0}.get(kind, 0.0)
    for name in SENSORS:
        broken = faults()
        broken.obey(START, SensorFault(1, name, kind, amount, 40))
        for tick in range(START, START + 80):
            values = broken.apply(tick, truth(tick))
            others = [field for field in range(7) if field not in PLACES[name]]
            assert [values[field] for field in others] == [truth(tick)[field] for field in others]
            assert broken.active(tick) == ({} if kind == OK or tick >= START + 40 else {name: kind})
            if tick >= START + 40:
                assert values == truth(tick)


def test_another_command_takes_the_place_of_the_one_before() -> None:
    broken = faults()
    broken.obey(START, SensorFault(1, "imu", "off", 0.0, 1000))
    broken.obey(START + 1, SensorFault(1, "imu", "stuck", 0.0, 0))
    assert broken.active(START + 5000) == {"imu": "stuck"}
    broken.obey(START + 2, SensorFault(1, "imu", OK, 0.0, 0))
    assert broken.apply(START + 2, truth(3)) == truth(3)


def test_all_are_those_that_the_board_has() -> None:
    broken = faults(has=("encoder", "torque"))
    broken.obey(START, SensorFault(1, ALL, "off", 0.0, 0))
    assert broken.active(START) == {"encoder": "off", "torque": "off"}
    values = broken.apply(START, truth(START))
    assert [isnan(value) for value in values] == [True, False, True, False, False, False, False]


@pytest.mark.parametrize(("kind", "amount"), [("garbage", 0.0), ("intermittent", 0.5)])
def test_chance_follows_from_seed_and_board(kind: FaultKind, amount: float) -> None:
    def run(seed: int, board: int) -> str:
        broken = faults(seed, board)
        broken.obey(START, SensorFault(1, ALL, kind, amount, 0))
        return repr(shown(broken, range(START, START + 50)))

    assert run(1, 1) == run(1, 1)
    assert run(1, 1) != run(2, 1)
    assert run(1, 1) != run(1, 2)


@pytest.mark.parametrize("start", [100, 101])
@pytest.mark.parametrize("every", [1, 2, 5])
def test_a_sensor_that_is_read_seldom_is_slow_and_late_by_the_same_time(
    start: int, every: int
) -> None:
    """In realtime a board's period is several ticks; amounts are in ticks all the same."""
    ticks = range(100, 300, every)
    kinds: tuple[FaultKind, ...] = "slow", "delayed"
    for kind in kinds:
        broken = SensorFaults(SENSORS, Chance(seed=1, board=1), every_ticks=every)
        broken.obey(start, SensorFault(1, "encoder", kind, 20, 0))
        ages = [
            round((truth(tick)[0] - broken.apply(tick, truth(tick))[0]) / 0.001)
            for tick in ticks
            if tick >= start
        ]
        assert max(ages) == (20 if kind == "delayed" else 20 - every)
        if kind == "delayed":
            assert set(ages[20 // every + 1 :]) == {20}
        else:
            assert ages.count(0) == pytest.approx(len(ages) * every / 20, abs=1)
