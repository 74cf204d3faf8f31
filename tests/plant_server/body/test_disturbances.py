"""Pushes last as many ticks as they were told, and add up."""

from plant_server.body.body import Body
from plant_server.body.chain import Chain
from plant_server.body.disturbances import Disturbances
from protocol.robot.events import Push
from tests.plant_server.body.oracle import random_links


def test_a_push_lasts_its_ticks_and_those_on_one_link_add_up() -> None:
    body = Body(
        Chain(random_links(2, seed=1)), initial_angles_rad=[0.0] * 2, tick_s=1e-3, substeps=1
    )
    disturbances = Disturbances()
    disturbances.begin(Push(1, 5.0, 3))
    disturbances.begin(Push(1, -2.0, 1))
    disturbances.begin(Push(0, 1.0, 2))
    acting = []
    for _ in range(4):
        disturbances.act_on(body)
        acting.append(body.forces_n)
    assert acting == [[1.0, 3.0], [1.0, 5.0], [0.0, 5.0], [0.0, 0.0]]
