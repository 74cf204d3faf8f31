"""A board's admission (S8, S11), what it refuses, its locality and its determinism."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.board import AnsweredError, ReplacedError
from protocol.robot.sensors import Readings
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_EPOCH,
    NO_TICK,
    Observation,
    ProtocolError,
    Reason,
    decode,
    encode,
)
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    PROPORTIONAL,
    ROUNDS,
    RUN,
    Robot,
    board,
    moving,
    observation,
    torque,
)


def test_a_board_admitted_late_starts_disabled_and_drives_when_its_delay_line_is_full() -> None:
    """S11, S17: y = 0 and 0 N m until synced; then it holds until an epoch elects it."""
    hip, admitted = board(2, PROPORTIONAL), PERIOD_TICKS + 5
    synced = admitted + DELAY_TICKS
    enabled_at = 2 * PERIOD_TICKS + ROUNDS
    for tick in range(admitted, enabled_at + 1):
        said = torque(hip.tick(hip.read(observation(2, tick, waits=0))))
        assert said.state == (State.SYNCING if tick < synced else State.RUNNING)
        assert said.enabled == (tick == enabled_at)
        assert said.epoch == (NO_EPOCH if tick < 2 * PERIOD_TICKS else 2)
        if tick <= synced:
            assert said.torque_nm == 0.0, "syncing, then holding the first sample"
        elif tick < enabled_at:
            held = moving(2, admitted)[3]
            assert said.torque_nm == pytest.approx(-100.0 * (said.controlled_rad - held))
    assert said.torque_nm == -100.0 * said.controlled_rad


def _for_hip(tick: int, **changes: Any) -> bytes:
    return encode(decode(Observation, observation(2, tick))._replace(**changes))


def test_an_observation_for_another_incarnation_ends_this_one() -> None:
    for incarnation in (2, 0):
        with pytest.raises(ReplacedError):
            board(2).read(_for_hip(0, incarnation=incarnation))


@pytest.mark.parametrize("tick", [-DELAY_TICKS, 2, 5, 400, NO_TICK])
def test_any_but_the_next_tick_is_refused(tick: int) -> None:
    hip = board(2)
    hip.tick(hip.read(_for_hip(3)))
    with pytest.raises(ProtocolError) as refused:
        hip.read(_for_hip(tick))
    assert refused.value.reason is Reason.TICK
    assert hip.read(_for_hip(4)).tick == 4


def test_an_observation_of_the_tick_just_answered_asks_for_the_answer_again() -> None:
    """It is nobody's fault, so it is not counted: the plant repeats by its own clock."""
    hip = board(2)
    hip.tick(hip.read(_for_hip(3)))
    with pytest.raises(AnsweredError):
        hip.read(_for_hip(3))
    assert not hip.refused


def test_what_does_not_fit_an_observation_is_refused_with_its_reason() -> None:
    cases = {
        Reason.SIZE: b"",
        Reason.CORRUPT: _for_hip(0)[:-1] + b"\x00",
        Reason.RUN: _for_hip(0, run_id=RUN + 1, incarnation=9),
        Reason.RANGE: _for_hip(0, neighbours=()),
        Reason.MALFORMED: board(2).tick(board(2).read(_for_hip(0))).torque,
    }
    for reason, payload in cases.items():
        with pytest.raises(ProtocolError) as refused:
            board(2).read(payload)
        assert refused.value.reason is reason


def test_a_board_never_sees_another_boards_sensors() -> None:
    """News of the hip in tick 20: passed on by the knee in 21, and used by the ankle in 20 + delay.

    Had the ankle seen the trunk itself, its answer would differ in tick 20.
    """
    news = 20

    def nudged(index: int, tick: int) -> Readings:
        sensed = moving(index, tick)
        if index != 2 or tick != news:
            return sensed
        return sensed._replace(imu_rad=sensed.imu_rad + 0.01)

    plain, told = Robot().run(news + 20), Robot(sensors=nudged).run(news + 20)
    differs = {
        index: next(tick for tick in plain if plain[tick][index] != told[tick][index])
        for index in range(3)
    }
    assert differs == {2: news, 1: news + 1, 0: news + DELAY_TICKS}


def test_sensors_that_a_board_does_not_carry_change_nothing() -> None:
    """An IMU reading that strays into the knee's observation is none of its business."""

    def strays(index: int, tick: int) -> Readings:
        sensed = moving(index, tick)
        if index == 2:
            return sensed
        return sensed._replace(imu_rad=0.9, imu_rad_s=0.9, foot_force_n=9.0, foot_cop_m=9.0)

    assert Robot(sensors=strays).run(20) == Robot().run(20)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.randoms(use_true_random=False))
def test_the_same_bytes_in_any_order_and_number_give_the_same_bytes(chance: Any) -> None:
    """Frames of a tick are shuffled, repeated, and mixed with some of the tick before."""
    ticks = range(-DELAY_TICKS, 2 * PERIOD_TICKS)
    robot = Robot()
    expected = [acts[1] for acts in robot.run(ticks.stop).values()]
    knee = board(1)
    old: list[tuple[int, bytes]] = []
    for tick, act, heard in zip(ticks, expected, robot.heard, strict=True):
        assert knee.tick(knee.read(observation(1, tick))) == act
        new = [(place, payload) for receiver, place, payload in heard if receiver == 1]
        arrivals = new * chance.randint(1, 3) + old
        chance.shuffle(arrivals)
        for place, payload in arrivals:
            knee.hear(place, payload)
        old = new


def test_two_runs_are_equal_to_the_byte() -> None:
    assert Robot().run(100) == Robot().run(100)


@pytest.mark.parametrize("silent_from", [0, 30])
def test_a_board_that_hears_nobody_goes_on_with_what_it_has(silent_from: int) -> None:
    """S9: an answer each tick, finite, with every step named; then the neighbours are back."""
    robot = Robot()
    knee, back = board(1), silent_from + 60
    states = {}
    for tick in range(-DELAY_TICKS, back + 2 * DELAY_TICKS):
        robot.tick(tick)
        said = torque(knee.tick(knee.read(observation(1, tick))))
        assert abs(said.torque_nm) < 1e3
        states[tick] = State(said.state)
        for receiver, place, payload in robot.heard[-1]:
            if receiver == 1 and not silent_from <= tick < back:
                knee.hear(place, payload)
    first_missing = silent_from + DELAY_TICKS  # When the first sample that was not heard is due.
    order = [states[tick] for tick in range(first_missing - 1, first_missing + 27)]
    assert order == [
        State.RUNNING,
        *[State.HOLDING] * 5,
        *[State.EXTRAPOLATING] * 20,
        *[State.RECKONING] * 2,
    ]
    assert states[back + 2 * DELAY_TICKS - 1] is State.RUNNING
