"""Pushes last as many ticks as they were told, and add up."""

from plant_server.body.disturbances import Pushes


def test_a_push_lasts_its_ticks_and_those_on_one_link_add_up() -> None:
    pushes = Pushes(2)
    pushes.add(1, 5.0, 3)
    pushes.add(1, -2.0, 1)
    pushes.add(0, 1.0, 2)
    told = [pushes.forces_n() for _ in range(4)]
    assert told == [[1.0, 3.0], [1.0, 5.0], [0.0, 5.0], [0.0, 0.0]]
