"""The roster: what each board is told of the others, of its links and of its reference."""

import pytest

from plant_server.session.roster import Roster
from protocol.robot.events import (
    ANY,
    PERFECT,
    BoardCommand,
    LinkChange,
    LinkOrder,
    LinkParameters,
    LinkRepair,
    Pairs,
    ReferenceChange,
    ReferenceOrder,
    decode_board_command,
)
from protocol.wire.frames import NO_TICK, Neighbour

ANKLE, KNEE, HIP = range(3)
LOSSY = LinkParameters(loss=0.2)
CUT = LinkParameters(cut=1.0)


def roster(
    standing: dict[tuple[int, int], LinkParameters] | None = None, *, size: int = 3
) -> Roster:
    """Everybody is here, and has been for a tick."""
    whole = Roster(size, standing or {}, [0.0] * size)
    for board in range(size):
        whole.admit(board, 1)
    whole.newcomers.clear()
    return whole


def told(whole: Roster, board: int) -> list[BoardCommand]:
    """What a board is to obey, tick after tick, until there is nothing more."""
    commands = []
    while payload := whole.command_for(board):
        command = decode_board_command(payload)
        assert command is not None
        commands.append(command)
    return commands


def test_a_board_is_told_of_links_to_it_and_of_no_others() -> None:
    whole = roster()
    whole.change(LinkChange(((ANKLE, KNEE), (KNEE, ANKLE)), {"cut": 1.0}))
    assert told(whole, ANKLE) == [LinkOrder(KNEE, CUT)]
    assert told(whole, KNEE) == [LinkOrder(ANKLE, CUT)]
    assert told(whole, HIP) == []


def test_s15_all_links_change_in_one_tick_for_everybody() -> None:
    """The board in the middle has two of them, and an observation carries one command."""
    whole = roster()
    whole.change(LinkChange((), {"loss": 0.2}))
    assert told(whole, ANKLE) == told(whole, HIP) == [LinkOrder(KNEE, LOSSY)]
    assert told(whole, KNEE) == [LinkOrder(ANY, LOSSY)]
    whole.change(LinkRepair(()))
    assert [len(told(whole, board)) for board in range(3)] == [1, 1, 1]


def test_s15_links_that_differ_take_a_tick_each() -> None:
    """What is queued is in order, one an observation."""
    whole = roster({(HIP, KNEE): LinkParameters(delay_ticks=3.0)})
    whole.change(LinkChange((), {"loss": 0.2}))
    assert told(whole, KNEE) == [
        LinkOrder(ANKLE, LOSSY),
        LinkOrder(HIP, LOSSY._replace(delay_ticks=3.0)),
    ]
    whole.change(LinkChange(((ANKLE, KNEE),), {"cut": 1.0}))
    whole.refer(ReferenceChange(KNEE, 0.1))
    whole.change(LinkChange(((ANKLE, KNEE),), {"cut": 0.0}))
    assert told(whole, KNEE) == [
        LinkOrder(ANKLE, LOSSY._replace(cut=1.0)),
        ReferenceOrder(0.1),
        LinkOrder(ANKLE, LOSSY),
    ]


def test_changes_add_up_and_healing_makes_perfect() -> None:
    """Also of what the scenario has for good."""
    whole = roster({(ANKLE, KNEE): LOSSY})
    whole.change(LinkChange(((ANKLE, KNEE),), {"delay_ticks": 2}))
    assert whole.links[ANKLE, KNEE] == LOSSY._replace(delay_ticks=2.0)
    whole.change(LinkRepair(((ANKLE, KNEE),)))
    assert whole.links[ANKLE, KNEE] == PERFECT
    assert told(whole, KNEE)[-1] == LinkOrder(ANKLE, PERFECT)


def test_a_new_board_is_told_what_has_changed_since_the_run_began() -> None:
    """It knows the scenario; and nothing waits for it from before."""
    whole = roster({(HIP, KNEE): LOSSY})
    whole.change(LinkChange(((ANKLE, KNEE),), {"cut": 1.0}))
    whole.remove(KNEE)
    whole.change(LinkChange(((ANKLE, KNEE),), {"loss": 0.2}))
    whole.refer(ReferenceChange(KNEE, 0.25))
    assert told(whole, KNEE) == []
    whole.admit(KNEE, 2)
    assert told(whole, KNEE) == [
        LinkOrder(ANKLE, CUT._replace(loss=0.2)),
        ReferenceOrder(0.25),
    ]


def test_a_new_board_is_not_told_what_it_knows() -> None:
    whole = roster({(HIP, KNEE): LOSSY})
    whole.change(LinkChange(((HIP, KNEE),), {"cut": 1.0}))
    whole.change(LinkChange(((HIP, KNEE),), {"cut": 0.0}))
    whole.remove(KNEE)
    whole.admit(KNEE, 2)
    assert told(whole, KNEE) == []


def test_the_neighbours_of_a_board() -> None:
    """The ends of the chain have one; who is absent has incarnation 0; nobody sees further."""
    whole = roster()
    whole.completed_ticks = [7, 8, 9]
    assert whole.neighbours_of(ANKLE) == (Neighbour(1, 8, 1),)
    assert whole.neighbours_of(KNEE) == (Neighbour(1, 7, 1), Neighbour(1, 9, 1))
    whole.remove(HIP)
    assert whole.neighbours_of(KNEE) == (Neighbour(1, 7, 1), Neighbour(0, 9, 1))
    whole.admit(HIP, 2)
    assert whole.neighbours_of(KNEE) == (Neighbour(1, 7, 1), Neighbour(2, NO_TICK, 1))
    assert whole.neighbours_of(HIP) == (Neighbour(1, NO_TICK, 1),)


@pytest.mark.parametrize(
    ("cut", "sides"),
    [
        ((), [[0, 1, 2, 3]]),
        (((1, 2),), [[0, 1, 2, 3]]),  # One way: they still hear of each other.
        (((1, 2), (2, 1)), [[0, 1], [2, 3]]),
        (((0, 1), (1, 0), (2, 3), (3, 2)), [[0], [1, 2], [3]]),
    ],
)
def test_sides_are_who_can_reach_whom(cut: Pairs, sides: list[list[int]]) -> None:
    whole = roster(size=4)
    if cut:
        whole.change(LinkChange(cut, {"cut": 1.0}))
    assert whole.sides() == sides


@pytest.mark.parametrize(
    ("absent", "sides"),
    [([0], [[1, 2, 3]]), ([1], [[0], [2, 3]]), ([1, 2], [[0], [3]]), ([0, 1, 2, 3], [])],
)
def test_sides_without_some_boards(absent: list[int], sides: list[list[int]]) -> None:
    whole = roster(size=4)
    for board in absent:
        whole.remove(board)
    assert whole.sides() == sides
