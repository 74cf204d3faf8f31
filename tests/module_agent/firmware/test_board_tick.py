"""One board's tick and epoch, in the order of S10 and S11."""

from math import cos, sin, tau

import pytest

from module_agent.firmware.kinematics import NOTHING, add_link
from module_agent.firmware.servo import Servo
from protocol.robot.sensors import Readings
from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame, decode
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    PROPORTIONAL,
    ROUNDS,
    THIGH,
    TRUNK,
    UNSENSED,
    Robot,
    board,
    link,
    moving,
    observation,
    still,
    torque,
)


def test_warm_up_answers_without_torque_and_without_election() -> None:
    """S8: normal barrier, torques 0, integrators 0, nothing elected."""
    robot = Robot()
    acts = robot.run(0)
    for act in (act for tick in acts.values() for act in tick):
        said = torque(act)
        assert (said.torque_nm, said.state, said.enabled) == (0.0, State.SYNCING, 1)
        assert said.epoch == NO_EPOCH
    servos = [one.servo for one in robot.boards]
    assert [servo.integral_rad_s for servo in servos if isinstance(servo, Servo)] == [0.0] * 3


def test_tick_0_drives_on_the_sample_of_one_lumped_delay_ago() -> None:
    """S8: every delay line is full then, the ankle's too, which needs two hops."""
    robot = Robot(gains=PROPORTIONAL)
    acts = robot.run(30)
    for tick in range(30):
        sample = tick - DELAY_TICKS
        trunk_rad, trunk_rate = moving(2, sample)[3:5]
        thigh = trunk_rad - moving(2, sample)[0], trunk_rate - 0.05
        shank = thigh[0] - moving(1, sample)[0], thigh[1] - 0.05
        whole = NOTHING
        for one, turn in zip((TRUNK, THIGH, THIGH), ((trunk_rad, 0.1), thigh, shank), strict=True):
            whole = add_link(one, *turn, whole)
        expected = [whole.sway_rad(), moving(1, sample)[0], trunk_rad]
        said = [torque(act) for act in acts[tick]]
        assert [frame.state for frame in said] == [State.RUNNING] * 3
        assert [frame.controlled_rad for frame in said] == pytest.approx(expected, abs=1e-14)
        if tick < ROUNDS:
            wanted = [-100.0 * frame.controlled_rad for frame in said]
            assert [frame.torque_nm for frame in said] == wanted


def test_rounds_are_said_in_k_and_heard_in_k_plus_1() -> None:
    """S10, S11: a board's own urgency in tick eT, its neighbours' one tick later, all by eT + R."""
    robot = Robot(gains=PROPORTIONAL, sensors=still)
    acts = robot.run(PERIOD_TICKS + ROUNDS + 1)
    for epoch, start in enumerate((0, PERIOD_TICKS)):
        own = [abs(torque(act).controlled_rad) for act in acts[start]]
        assert max(own) == own[2], "the hip is most urgent"
        said = [[link(act) for act in acts[start + round_]] for round_ in range(ROUNDS + 1)]
        assert [[frame.candidate for frame in round_] for round_ in said] == [
            [0, 1, 2],
            [max((0, 1), key=lambda i: own[i]), 2, 2],
            [2, 2, 2],
        ]
        for round_, frames in enumerate(said):
            for frame in frames:
                assert (frame.epoch, frame.round) == (epoch, round_)
                assert frame.urgency == own[frame.candidate]


def test_all_are_enabled_before_the_first_latch_and_one_from_it_on() -> None:
    robot = Robot(sensors=still)
    acts = robot.run(3 * PERIOD_TICKS)
    enabled = {tick: [torque(act).enabled for act in acts[tick]] for tick in acts}
    assert all(enabled[tick] == [1, 1, 1] for tick in range(-DELAY_TICKS, ROUNDS))
    assert all(enabled[tick] == [0, 0, 1] for tick in range(ROUNDS, 3 * PERIOD_TICKS))


def test_the_servo_uses_the_new_y_in_the_tick_that_latches_it() -> None:
    """S10: latch before servo. A board that has just lost holds, so its error is 0 at once."""
    acts = Robot(gains=PROPORTIONAL, sensors=still).run(ROUNDS + 1)
    before = [torque(act) for act in acts[ROUNDS - 1]]
    latched = [torque(act) for act in acts[ROUNDS]]
    assert all(frame.torque_nm == -100.0 * frame.controlled_rad != 0.0 for frame in before)
    assert [frame.torque_nm for frame in latched] == [0.0, 0.0, -100.0 * latched[2].controlled_rad]


def test_a_disabled_board_holds_the_sample_of_the_tick_that_disabled_it() -> None:
    """S11: not of the tick in which the epoch began; and the same value through later epochs."""

    def sensors(index: int, tick: int) -> Readings:
        return moving(index, tick) if index != 2 else still(index, tick)

    acts = Robot(gains=PROPORTIONAL, sensors=sensors).run(3 * PERIOD_TICKS)
    held = torque(acts[ROUNDS][1]).controlled_rad
    for tick in range(ROUNDS, 3 * PERIOD_TICKS):
        knee = torque(acts[tick][1])
        assert knee.enabled == 0
        assert knee.torque_nm == -100.0 * (knee.controlled_rad - held)


def test_without_an_election_all_stay_enabled() -> None:
    """The original DEC."""
    lone = board(2, election=None)
    for tick in range(-DELAY_TICKS, 2 * PERIOD_TICKS):
        act = lone.tick(lone.read(observation(2, tick, waits=0)))
        assert torque(act).enabled == 1
        assert link(act).epoch == NO_EPOCH


def test_receipts_name_what_was_used_and_what_was_sent() -> None:
    """S18, S22: a mask of the frames used, and the CRC of each frame sent."""
    robot = Robot()
    for tick, acts in robot.run(5).items():
        for act in acts:
            masks = [use.heard_mask for use in torque(act).links]
            assert masks == [int(tick > -DELAY_TICKS)] * len(act.links)
            sent = [use.sent_crc.to_bytes(4, "little") for use in torque(act).links]
            assert sent == [payload[-4:] for payload in act.links]
            for payload in act.links:
                last = tick - 1 if tick > -DELAY_TICKS else NO_TICK
                assert decode(LinkFrame, payload).heard_tick == last


def test_a_board_waits_for_frames_that_are_due_and_for_no_others() -> None:
    knee = board(1)
    first = knee.read(observation(1, -DELAY_TICKS))
    assert knee.missing(first) is None, "nobody has completed a tick yet"
    knee.tick(first)
    second = knee.read(observation(1, 1 - DELAY_TICKS))
    assert knee.missing(second) == 0
    robot = Robot()
    robot.tick(-DELAY_TICKS)
    for receiver, place, payload in robot.heard[0]:
        if receiver == 1:
            assert knee.missing(second) is not None
            knee.hear(place, payload)
    assert knee.missing(second) is None
    idle = knee.read(observation(1, 1 - DELAY_TICKS, waits=0))
    assert board(1).missing(idle) is None


def test_a_board_that_is_disabled_again_holds_anew() -> None:
    """The hip leads in epochs 0 and 2, the knee in epoch 1: what it held before is forgotten."""

    def sensors(index: int, tick: int) -> Readings:
        turn = tau / (2 * PERIOD_TICKS)
        if index == 1:
            return UNSENSED._replace(joint_rad=0.3 + 0.001 * tick, joint_rad_s=1.0)
        swing = 0.45 * (1.0 + cos(turn * tick)), -450.0 * turn * sin(turn * tick)
        return UNSENSED._replace(imu_rad=swing[0], imu_rad_s=swing[1]) if index == 2 else UNSENSED

    acts = Robot(gains=PROPORTIONAL, sensors=sensors).run(3 * PERIOD_TICKS)
    latches = [epoch * PERIOD_TICKS + ROUNDS for epoch in range(3)]
    assert [torque(acts[tick][1]).enabled for tick in latches] == [0, 1, 0]
    for tick in (latches[0], latches[2]):
        held = torque(acts[tick][1]).controlled_rad
        later = torque(acts[tick + 10][1])
        assert later.torque_nm == -100.0 * (later.controlled_rad - held) != 0.0
