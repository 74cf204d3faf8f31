"""The job that every system has to do, on those that need nothing but what decmesh needs."""

from pathlib import Path

import pytest

from tests.bench import knobs
from tests.bench.children import ChildFailedError, Children, UnavailableError
from tests.bench.hanging import hanging
from tests.bench.job import Place, near, partners, tick_figures
from tests.bench.systems import AS_IT_COMES, OUR_SETTINGS, SYSTEMS, System, do_job


def test_boards_have_their_neighbours_and_the_plant() -> None:
    assert partners(0, 3) == [1, 2, 3]
    assert [near(role, 3) for role in (1, 2, 3)] == [[2], [1, 3], [2]]
    assert partners(1, 1) == [0]
    for role in range(6):
        assert all(role in partners(other, 5) for other in partners(role, 5))


def test_figures_of_ticks_come_from_the_times_between_them() -> None:
    """99 ticks of 100 µs and one of 1 ms: the rate counts it, the median does not see it."""
    stamps_ns = [100_000 * tick for tick in range(100)]
    stamps_ns.append(stamps_ns[-1] + 1_000_000)
    figures = tick_figures(stamps_ns)
    assert figures["ticks_per_s"] == pytest.approx(100 / 0.0109)
    assert figures["p50_us"] == pytest.approx(100.0)
    assert 100.0 < figures["p99_us"] < 1000.0


def test_a_place_is_read_as_it_was_written(tmp_path: Path) -> None:
    place = Place(tmp_path, 17_700, 3, 10, 20, {"cores": "one"})
    place.write()
    assert Place.read(tmp_path) == place


@pytest.mark.parametrize(
    "system", [*SYSTEMS[:2], AS_IT_COMES, OUR_SETTINGS], ids=lambda system: system.name
)
def test_it_is_done_to_the_end(system: System) -> None:
    """Every role checks the tick of every frame; the figures are of as many ticks as asked for."""
    figures = do_job(system, warm_up=5, ticks=20)
    assert set(figures) == {"ticks_per_s", "p50_us", "p99_us", "cpu_us"}
    assert all(value > 0.0 for value in figures.values())


def test_what_is_not_installed_is_said_before_anything_starts() -> None:
    with pytest.raises(UnavailableError, match="no-such-thing is not installed"):
        do_job(System("some", "zeromq", "no-such-thing"), warm_up=1, ticks=1)
    with pytest.raises(UnavailableError, match="no program no-such-thing"):
        do_job(System("some", "mqtt", program="no-such-thing"), warm_up=1, ticks=1)


def test_a_role_that_dies_ends_the_job_with_its_last_line(tmp_path: Path) -> None:
    with Children(tmp_path) as children:
        children.start("sleeper", ["sleep", "100"])
        children.start("speaker", ["sh", "-c", "echo oh dear; exit 3"])
        with pytest.raises(ChildFailedError, match="speaker ended with code 3: oh dear"):
            children.wait(["sleeper", "speaker"], 20.0)
    assert children.processes["sleeper"].poll() is not None


def test_cores_are_shared_out_as_a_layout_says() -> None:
    def layout(name: str, there: list[int]) -> list[set[int]]:
        return [knobs.cores(name, role, there) for role in range(4)]

    assert layout("one", [2, 5]) == [{2}] * 4
    assert layout("plant-apart", [2, 5]) == [{2}, {5}, {5}, {5}]
    assert layout("plant-apart", [2]) == [{2}] * 4


def test_a_hanging_chain_waits_for_what_is_far_away() -> None:
    """As every scenario must: no lumped delay is shorter than the hops to the top."""
    boards = hanging(40).boards
    delays = [board.lumped_delay_ticks for board in boards]
    assert all(delay >= 39 - index for index, delay in enumerate(delays))
