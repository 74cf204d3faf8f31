"""A board without a body elects as any other does, with whichever boards are its neighbours."""

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.elector import Ballot, Elector, ElectorConfig, urgency
from protocol.robot.chance import draw
from protocol.wire.frames import LinkFrame, Reason, decode

RUN = 0x8000_0001
Near = Sequence[tuple[int, ...]]
GRAPHS: dict[str, tuple[Near, int]] = {
    "pair": ([(1,), (0,)], 1),
    "line": ([(1,), (0, 2), (1, 3), (2,)], 3),
    "ring": ([(1, 4), (0, 2), (1, 3), (2, 4), (0, 3)], 2),
    "star": ([(1, 2, 3, 4), (0,), (0,), (0,), (0,)], 2),
    "all": ([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)], 1),
}
"""Whom each board hears, and the hops from end to end."""


def electors(near: Near, *, rounds: int, watched: int = 0, loss: float = 0.0) -> list[Elector]:
    return [
        Elector(
            ElectorConfig(
                index=board,
                neighbours=others,
                boards=len(near),
                seed=5,
                loss=loss,
                rounds=rounds,
                watched_rounds=max(rounds, watched),
            ),
            run_id=RUN,
        )
        for board, others in enumerate(near)
    ]


def play(boards: list[Elector], epochs: int) -> list[list[Ballot]]:
    """Everybody ticks, then everything said arrives; the ballots of each epoch."""
    found = []
    for _ in range(epochs * boards[0].config.period_ticks):
        said = [board.tick() for board in boards]
        for board in boards:
            for link, sender in enumerate(board.config.neighbours):
                to = boards[sender].config.neighbours.index(board.config.index)
                board.hear(link, said[sender][to])
        ballots = [board.ballot() for board in boards]
        if ballots[0] is not None:
            found.append([ballot for ballot in ballots if ballot is not None])
    return found


@pytest.mark.parametrize("graph", GRAPHS)
def test_on_any_graph_all_agree_after_as_many_rounds_as_it_is_wide(graph: str) -> None:
    """Equation achievedMaxCons, frames and all; one board takes itself for the largest."""
    near, hops = GRAPHS[graph]
    epochs = play(electors(near, rounds=hops), 40)
    assert [ballots[0].epoch for ballots in epochs] == list(range(40))
    for ballots in epochs:
        largest = max((ballot.urgency, board) for board, ballot in enumerate(ballots))
        assert {ballot.best for ballot in ballots} == {largest}
        assert [ballot.elected for ballot in ballots].count(True) == 1
        assert ballots[largest[1]].elected
    assert max(ballot.learned_round for ballots in epochs for ballot in ballots) == hops


def test_a_board_learns_in_as_many_rounds_as_the_largest_is_hops_away() -> None:
    near, _ = GRAPHS["line"]
    for ballots in play(electors(near, rounds=3), 30):
        best = ballots[0].best.board
        assert [b.learned_round for b in ballots] == [abs(board - best) for board in range(4)]


def test_what_is_watched_after_r_does_not_change_who_is_elected_after_r() -> None:
    """Lost frames are drawn by tick, so epoch 0 is the same however long it is watched."""
    near, hops = GRAPHS["ring"]
    elected = [
        [b.elected for b in play(electors(near, rounds=hops, watched=watched, loss=0.5), 1)[0]]
        for watched in (hops, 30)
    ]
    assert elected[0] == elected[1]
    assert elected[0].count(True) > 1, "the seed shows a case of doubt"
    assert len({b.best for b in play(electors(near, rounds=2, watched=30, loss=0.5), 1)[0]}) == 1


def test_the_barrier_is_the_neighbours_frames_of_the_tick_before_and_nobody_elses() -> None:
    near, _ = GRAPHS["line"]
    boards = electors(near, rounds=3)
    said = [board.tick() for board in boards]
    assert boards[1].missing() == 0
    boards[1].hear(1, said[2][0])
    assert boards[1].missing() == 0
    boards[1].hear(0, said[0][0])
    assert boards[1].missing() is None
    boards[1].tick()
    assert boards[1].missing() == 0


def test_nothing_is_waited_for_before_the_first_tick() -> None:
    near, _ = GRAPHS["line"]
    assert [board.missing() for board in electors(near, rounds=3)] == [None] * 4


def test_frames_are_those_of_a_board_with_a_body_and_another_run_is_refused() -> None:
    near, _ = GRAPHS["pair"]
    here, there = electors(near, rounds=1)
    (payload,) = there.tick()
    frame = decode(LinkFrame, payload)
    assert (frame.run_id, frame.tick, frame.candidate) == (RUN, 0, 1)
    here.tick()
    stranger = Elector(there.config, run_id=RUN + 1)
    here.hear(0, stranger.tick()[0])
    assert here.missing() == 0
    assert here.hearings[0].refused[Reason.RUN] == 1


@given(st.integers(0, 2**63 - 1), st.integers(0, 99), st.integers(0, 9999))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_urgencies_are_drawn_apart_from_all_fates(seed: int, board: int, epoch: int) -> None:
    """Of a link from a board to itself, which does not exist."""
    drawn = urgency(seed, board, epoch)
    assert 0.0 <= drawn < 1.0
    assert drawn == (draw(seed, board, board, epoch, 0) >> 11) * 2.0**-53


def test_urgencies_are_uniform() -> None:
    drawn = sorted(urgency(1, board, epoch) for board in range(10) for epoch in range(1000))
    assert len(set(drawn)) == len(drawn)
    worst = max(abs(value - (n + 0.5) / len(drawn)) for n, value in enumerate(drawn))
    assert worst < 1.95 / len(drawn) ** 0.5  # Kolmogorov and Smirnov, 99.9 %.
