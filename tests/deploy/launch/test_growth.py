"""What a tick of the twin costs as robots grow, counted, not timed."""

import gc

import pytest

from deploy.launch.twin import Twin
from deploy.scenario_file.load import load
from tests.bench.hanging import hanging
from tests.work import lines_run

pytestmark = pytest.mark.slow


def lines_of_ticks(boards: int, ticks: int) -> int:
    """Lines that run in a few ticks of a chain whose delay lines are full, all boards electing."""
    twin = Twin(hanging(boards))
    while twin.lockstep.plant.tick <= 0:
        twin.tick()
    return lines_run(lambda: [twin.tick() for _ in range(ticks)])


def test_a_tick_is_linear_in_its_boards() -> None:
    """Twice the boards, twice the work: of the plant, of the boards, and of what lies between.

    Not quite to the line, because the boards at the ends have one neighbour, and an urgency that
    wins later is another path through an election: 1 % of a round.
    """
    first, second, third = (lines_of_ticks(boards, 4) for boards in (16, 32, 64))
    assert third - second == pytest.approx(2 * (second - first), rel=0.01)


@pytest.mark.parametrize("name", ["paper", "bursty"])
def test_a_tick_makes_no_cycles(name: str) -> None:
    """So the twin may leave its memory to reference counts while it lives."""
    twin = Twin(load(name))
    for record in twin.run():
        if record.tick == 0:
            gc.collect()
    assert gc.collect() == 0
    assert twin.lockstep.plant.tick > 1000


def test_a_run_that_is_left_gives_the_collector_back() -> None:
    for _record in Twin(load("paper")).run():
        assert not gc.isenabled()
        break
    assert gc.isenabled()
