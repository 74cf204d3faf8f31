"""The plant in realtime: nobody is waited for, the latest torque counts, and not for ever."""

from math import radians
from typing import Any

import pytest

from deploy.scenario_file.load import load
from plant_server.session.config import plant_config
from plant_server.session.free_running import FreeRunning
from plant_server.session.plant import Plant
from plant_server.session.record import TickRecord
from protocol.robot.events import (
    Departure,
    EnergyLoss,
    FreshTorque,
    ReferenceChange,
    Sides,
    StaleTorque,
)
from protocol.robot.hardware import ClockSheet
from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, LinkUse, Observation, Reason, TorqueFrame, decode, encode
from protocol.wire.trace import Mark, TakenFrames, TickTrace
from protocol.wire.trace_differences import TraceWriter

RUN = 2**31 + 9
RATES = ("board.0.rate_hz=500", "board.1.rate_hz=1000", "board.2.rate_hz=250")


def made(*settings: str, admitted: tuple[int, ...] = (0, 1, 2)) -> FreeRunning:
    scenario = load("paper", ["run.mode=realtime", *RATES, "realtime.age_max_ms=20", *settings])
    running = FreeRunning(Plant(plant_config(scenario), run_id=RUN))
    for board in admitted:
        running.plant.admit(board, 1)
    return running


def torque(board: int, tick: int, torque_nm: float, **changes: Any) -> bytes:
    links = (LinkUse(0, 0, 0),) * (2 if board == 1 else 1)
    frame = TorqueFrame(
        RUN, 1, tick, torque_nm, State.RUNNING, 1, 0.0, NO_EPOCH, 0, 0.0, board, 0, 0, links
    )
    return encode(frame._replace(**changes))


def play(running: FreeRunning) -> tuple[list[int], TickRecord]:
    running.plant.begin()
    told = [board for board, _ in running.open()]
    return told, running.close()


def released(running: FreeRunning) -> FreeRunning:
    while running.plant.tick < 0:
        play(running)
    return running


def test_it_holds_the_body_until_boards_know_its_clock() -> None:
    running = made()
    assert running.plant.tick == -510, "half a second and a delay line"
    _, record = play(running)
    assert record.tick == -510
    while running.plant.tick < 0:
        _, last = play(running)
    assert last.angles_rad == record.angles_rad


def test_each_board_is_told_when_its_period_begins() -> None:
    running = released(made())
    assert [play(running)[0] for _ in range(5)] == [[0, 1, 2], [1], [0, 1], [1], [0, 1, 2]]


def test_an_observation_names_its_tick() -> None:
    running = released(made())
    assert {decode(Observation, payload).tick for _, payload in running.open()} == {0}


def test_the_latest_torque_is_in_force_until_a_newer_one_comes() -> None:
    running = released(made())
    assert running.answer(0, torque(0, 0, 5.0))
    applied = [play(running)[1].torques_nm[0] for _ in range(3)]
    assert running.answer(0, torque(0, 2, 7.0))
    assert not running.answer(0, torque(0, 2, 8.0)), "said again, and not the same"
    assert not running.answer(0, torque(0, 0, 5.0)), "overtaken on the way"
    applied.append(play(running)[1].torques_nm[0])
    assert applied == [5.0, 5.0, 5.0, 7.0]
    assert not running.plant.refused


def test_the_record_has_the_frames_in_force() -> None:
    running = released(made())
    payload = torque(1, 0, 1.0)
    running.answer(1, payload)
    assert [play(running)[1].answers for _ in range(2)] == [(b"", payload, b"")] * 2


def test_a_torque_that_is_too_old_is_not_applied_and_counted() -> None:
    running = released(made())
    running.answer(0, torque(0, 0, 5.0))
    records = [play(running)[1] for _ in range(30)]
    assert [record.torques_nm[0] for record in records] == [5.0] * 21 + [0.0] * 9
    assert running.stale_ticks == [9, 0, 0]
    assert StaleTorque(0) in records[21].events
    running.answer(0, torque(0, 28, 6.0))
    record = play(running)[1]
    assert record.torques_nm[0] == 6.0
    assert FreshTorque(0) in record.events


def test_a_clock_that_is_ahead_makes_no_torque_younger() -> None:
    running = released(made())
    assert running.answer(0, torque(0, 100, 5.0))
    assert [play(running)[1].torques_nm[0] for _ in range(22)] == [5.0] * 21 + [0.0]


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (torque(0, 0, 1.0)[:-1] + b"\x00", Reason.CORRUPT),
        (torque(0, 0, 1.0, run_id=RUN + 1), Reason.RUN),
        (torque(0, 0, 1.0, incarnation=2), Reason.INCARNATION),
        (torque(0, 252, 1.0), Reason.TICK),
        (torque(0, 0, 1.0, state=99), Reason.RANGE),
    ],
    ids=["crc", "run", "incarnation", "future", "state"],
)
def test_what_is_no_torque_of_a_board_is_refused(payload: bytes, reason: Reason) -> None:
    running = released(made())
    assert not running.answer(0, payload)
    assert running.plant.refused == {reason: 1}
    assert play(running)[1].torques_nm[0] == 0.0


def test_no_number_is_replaced_and_too_much_is_cut() -> None:
    running = released(made())
    running.answer(0, torque(0, 0, 5.0))
    running.answer(0, torque(0, 2, float("nan")))
    assert play(running)[1].torques_nm[0] == 5.0
    running.answer(0, torque(0, 4, 1e9))
    assert play(running)[1].torques_nm[0] == 1000.0
    assert (running.plant.actuators.invalid_torques, running.plant.actuators.saturated) == (1, 1)


def test_a_board_that_goes_leaves_its_joint_unattended_at_once() -> None:
    running = released(made("unattended.how=braked"))
    running.answer(1, torque(1, 0, 50.0))
    for _ in range(10):
        play(running)
    running.remove(1, "died")
    _, record = play(running)
    assert [type(event) for event in record.events] == [Departure, EnergyLoss, Sides]
    angle_rad = running.plant.body.angles_rad[1]
    for _ in range(10):
        told, _ = play(running)
        assert 1 not in told
    assert running.plant.body.angles_rad[1] == angle_rad


def test_its_successor_drives_when_it_says_so() -> None:
    running = released(made("unattended.how=braked"))
    running.remove(1, "died")
    play(running)
    running.plant.admit(1, 2)
    assert not running.answer(1, torque(1, 0, 50.0)), "of the one before"
    running.answer(1, torque(1, 2, 0.0, incarnation=2, state=State.SYNCING))
    play(running)
    assert running.plant.body._braked[1]
    running.answer(1, torque(1, 3, 9.0, incarnation=2))
    assert play(running)[1].torques_nm[1] == 9.0
    assert not running.plant.body._braked[1]


def test_commands_reach_a_board_in_its_next_observation() -> None:
    """At most one in each, and none is lost in a tick in which the board is told nothing."""
    running = released(made())
    while running.plant.tick % 4 != 1:
        play(running)
    for rad in (0.1, 0.2):
        running.plant.agenda.add(running.plant.tick, ReferenceChange(2, rad))
    told = []
    for _ in range(12):
        running.plant.begin()
        told += [
            (running.plant.tick % 4, decode(Observation, payload).command != b"")
            for board, payload in running.open()
            if board == 2
        ]
        running.close()
    assert told == [(0, True), (0, True), (0, False)]


def test_what_boards_tell_of_their_time_is_counted() -> None:
    running = made()
    writer = TraceWriter(run_id=RUN, incarnation=1, links=1)
    writer.add(TickTrace(0, 10, 90, 200, 0, 0, 0, 0, (TakenFrames(0, 0),)))
    writer.add(TickTrace(4, 10, 7000, 200, 0, 0, 3, Mark.LATE, (TakenFrames(0, 0),)))
    frame = writer.flush()
    assert frame is not None
    assert running.take_trace(0, frame)
    tally = running.tallies[0]
    assert (tally.periods, tally.missed, tally.late_us_max) == (5, 4, 7000)
    assert not running.take_trace(0, frame[:-1])
    other = TraceWriter(run_id=RUN + 1, incarnation=1, links=1)
    other.add(TickTrace(0, 10, 90, 200, 0, 0, 0, 0, (TakenFrames(0, 0),)))
    assert not running.take_trace(0, other.flush() or b"")
    assert set(running.plant.refused) == {Reason.CORRUPT, Reason.RUN}


def test_the_plant_makes_up_no_clock_for_boards_that_have_one() -> None:
    """Start-up takes its ticks as in lockstep; readings are as old as they are."""
    settings = ("board.1.clock.skew_ppm=-500", "board.1.clock.start_up_ms=30")
    clocks = made(*settings).plant.config.clock_sheets
    assert clocks[1] == ClockSheet(start_up_ticks=30)


def test_motors_sensors_and_passive_joints_are_as_in_lockstep() -> None:
    running = released(made("board.0.actuator.lag_ms=10", "board.0.sensors.encoder_offset_deg=1"))
    running.answer(0, torque(0, 0, 5.0))
    assert 0.0 < play(running)[1].torques_nm[0] < 5.0
    while running.plant.tick % 2:
        play(running)
    (told,) = [decode(Observation, payload) for board, payload in running.open() if board == 0]
    assert told.readings.joint_rad == running.plant.body.angles_rad[0] + radians(1.0)
