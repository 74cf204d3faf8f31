"""The agenda: at most one command a tick, in an order that anybody can foretell (S15)."""

from hypothesis import given
from hypothesis import strategies as st

from plant_server.session.agenda import Agenda
from protocol.robot import events
from protocol.robot.events import Plug, Push, Unplug

Entries = list[tuple[int, events.Scheduled]]


def push(number: int) -> Push:
    return Push(0, float(number), 1)


def _number(command: events.Scheduled) -> int:
    assert isinstance(command, Push)
    return int(command.force_n)


def played(agenda: Agenda, ticks: range) -> dict[int, events.Scheduled]:
    """What comes when."""
    due = {tick: agenda.due(tick) for tick in ticks}
    return {tick: command for tick, command in due.items() if command is not None}


def test_a_command_comes_in_its_tick() -> None:
    scheduled: Entries = [(7, push(7)), (2, push(2))]
    assert played(Agenda(scheduled), range(-5, 20)) == {2: push(2), 7: push(7)}


def test_commands_of_one_tick_come_one_after_the_other_as_they_were_given() -> None:
    """Those of later ticks wait for them."""
    scheduled: Entries = [(3, push(0)), (3, push(1)), (4, push(2)), (3, push(3)), (9, push(4))]
    commands = played(Agenda(scheduled), range(20))
    assert commands == {3: push(0), 4: push(1), 5: push(3), 6: push(2), 9: push(4)}


@given(st.lists(st.integers(0, 30)))
def test_nothing_is_lost_nothing_comes_early_and_nothing_waits_for_an_empty_tick(
    ticks: list[int],
) -> None:
    agenda = Agenda([(tick, push(number)) for number, tick in enumerate(ticks)])
    came = {_number(command): tick for tick, command in played(agenda, range(100)).items()}
    assert sorted(came) == list(range(len(ticks)))
    busy = set(came.values())
    for number, tick in came.items():
        assert tick >= ticks[number]
        assert busy.issuperset(range(ticks[number], tick))
    in_turn = sorted(came, key=came.__getitem__)
    assert in_turn == sorted(came, key=lambda number: (ticks[number], number))


@given(st.lists(st.integers(0, 20)), st.lists(st.integers(0, 3), max_size=12))
def test_the_turn_that_is_promised_is_the_turn_that_comes(
    scheduled: list[int], given: list[int]
) -> None:
    """Whatever is on the agenda already, and whatever is given later."""
    agenda = Agenda([(tick, push(-1)) for tick in scheduled])
    promised: dict[int, int] = {}
    came: dict[int, int] = {}
    for tick in range(60):
        command = agenda.due(tick)
        if command is not None and _number(command) >= 0:
            came[_number(command)] = tick
        for _ in range(given[tick] if tick < len(given) else 0):
            number = len(promised)
            promised[number] = agenda.turn(tick + 1)
            agenda.add(tick + 1, push(number))
    assert came == promised


def test_whether_a_board_is_to_be_put_in_is_known() -> None:
    agenda = Agenda([(5, Plug(2)), (3, Unplug(1))])
    assert [agenda.expects_plug(board) for board in range(3)] == [False, False, True]
    assert agenda.due(3) == Unplug(1)
    assert agenda.due(5) == Plug(2)
    assert not agenda.expects_plug(2)
