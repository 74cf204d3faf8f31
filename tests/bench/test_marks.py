"""The path of a tick, from what plant and boards have noted."""

import pytest

from tests.bench.marks import Mark, path


def noted(start_us: int, *, opens: int = 0) -> tuple[dict[str, list[Mark]], dict[str, list[Mark]]]:
    """One tick of a plant with one board, each step one microsecond longer than the one before."""
    at, names = start_us, ("put", "seen", "begun", "thought", "said", "came", "closed")
    marks: dict[str, list[Mark]] = {"opens": [(1000 * (at + opens), 0)]}
    for number, name in enumerate(names, start=1):
        at += number
        marks[name] = [(1000 * at, 0)]
    plant = {name: marks[name] for name in ("opens", "put", "came", "closed")}
    return plant, {name: marks[name] for name in ("seen", "begun", "thought", "said")}


def test_the_steps_add_up_to_the_tick() -> None:
    plant, board = noted(500)
    steps = path(plant, [board], 1)
    assert list(steps.values()) == pytest.approx([28.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0])


def test_the_path_leads_along_the_board_that_answers_last() -> None:
    """The upper board is told first and answers last: its marks count, not the other's."""
    plant, board = noted(0)
    early: dict[str, list[Mark]] = {name: [(7_000, 0)] for name in board}
    plant["put"] = [(marks[0], 1) for marks in plant["put"]] + [(8_000, 0)]
    plant["came"] = [(9_000, 0), *((at, 1) for at, _ in plant["came"])]
    assert path(plant, [early, board], 1)["think_us"] == pytest.approx(4.0)


def test_only_the_last_ticks_count() -> None:
    first, second = noted(0), noted(100, opens=-50)
    plant = {name: second[0][name] + first[0][name] for name in first[0]}
    board = {name: second[1][name] + first[1][name] for name in first[1]}
    assert path(plant, [board], 1)["open_us"] == pytest.approx(1.0)
    assert path(plant, [board], 2)["open_us"] == pytest.approx(26.0)
