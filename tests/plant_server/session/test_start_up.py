"""A board that is plugged in takes a while: until then it is nobody."""

from plant_server.session.lockstep import Lockstep
from protocol.robot.events import Command, Plug, Unplug
from protocol.robot.hardware import STEADY, ClockSheet
from protocol.robot.sensors import EXACT
from tests.plant_server.plant import KNEE, happened, plant, play

SLOW = ClockSheet(start_up_ticks=20, start_up_jitter_ticks=5)


def pulled(sheet: ClockSheet, *more: tuple[int, Command], seed: int = 0) -> Lockstep:
    """A plant whose knee has been pulled out, and is plugged in again at tick 10."""
    events = [(10, Plug(KNEE)), *more]
    lockstep = plant(
        events=events, sensor_sheets=(EXACT,) * 3, clock_sheets=(STEADY, sheet, STEADY), seed=seed
    )
    lockstep.remove(KNEE, "died")
    return lockstep


def admitted(lockstep: Lockstep, ticks: int = 60) -> int | None:
    """In which tick the driver is asked to put the knee in."""
    for _ in range(ticks):
        if lockstep.plant.begin() == Plug(KNEE):
            return lockstep.plant.tick
        list(lockstep.open())
        for board in lockstep.waiting_for:
            lockstep.remove(board, "died")
        lockstep.close()
    return None


def test_a_board_that_starts_at_once_is_there_at_once() -> None:
    assert admitted(pulled(STEADY)) == 10


def test_a_slow_one_is_there_later_by_its_time_and_some_jitter() -> None:
    seen = {admitted(pulled(SLOW, seed=seed)) for seed in range(60)}
    assert seen == set(range(30, 36))
    assert admitted(pulled(SLOW, seed=7)) == admitted(pulled(SLOW, seed=7))


def test_it_is_asked_for_once_however_often_it_is_plugged_in() -> None:
    lockstep = pulled(SLOW, (15, Plug(KNEE)), (20, Plug(KNEE)))
    first = admitted(lockstep)
    assert first is not None
    assert 30 <= first <= 35
    list(lockstep.open())
    for board in lockstep.waiting_for:
        lockstep.remove(board, "died")
    lockstep.close()
    assert admitted(lockstep) is None


def test_pulled_out_again_while_it_starts_it_never_comes() -> None:
    assert admitted(pulled(SLOW, (15, Unplug(KNEE)))) is None


def test_the_plant_goes_on_meanwhile_and_says_when_it_is_ready() -> None:
    lockstep = pulled(SLOW)
    records = [play(lockstep) for _ in range(28)]
    assert [record.tick for record in records if happened(record, "plug")] == [10]
    assert lockstep.plant.start_up.under_way(KNEE)
    assert lockstep.plant.agenda.expects_plug(KNEE)
    assert all(not record.answers[KNEE] for record in records)
    later = [play(lockstep) for _ in range(10)]
    (ready,) = (record.tick for record in later if happened(record, "ready"))
    assert 30 <= ready <= 35


def test_boards_with_which_a_run_begins_have_started_up() -> None:
    lockstep = plant(sensor_sheets=(EXACT,) * 3, clock_sheets=(SLOW,) * 3)
    assert all(play(lockstep).answers)
