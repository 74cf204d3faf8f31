"""Written out or in loops: the same equations, to the bit."""

import random

import pytest

from plant_server.body.body import Body
from plant_server.body.chain import Chain
from plant_server.body.unrolled import LINKS_MAX
from protocol.robot.hardware import Link


def some_chain(dice: random.Random, size: int) -> Chain:
    links = []
    for _ in range(size):
        mass_kg, length_m = dice.uniform(0.1, 40.0), dice.uniform(0.05, 1.0)
        inertia = mass_kg * length_m**2 / dice.uniform(6.0, 20.0)
        links.append(Link(mass_kg, length_m, length_m * dice.uniform(0.1, 1.0), inertia))
    return Chain(links)


@pytest.mark.parametrize("size", range(1, LINKS_MAX + 1))
def test_written_out_equations_are_those_in_loops_to_the_bit(size: int) -> None:
    """Equality, not closeness: the order of every operation is the same."""
    dice = random.Random(size)
    for _ in range(20):
        chain = some_chain(dice, size)
        angles, rates, torques = (
            [dice.uniform(-span, span) for _ in range(size)] for span in (3.2, 20.0, 300.0)
        )
        written_out = chain.accelerations_rad_s2(angles, rates, torques)
        assert written_out == chain.accelerations_in_loops_rad_s2(angles, rates, torques)


def test_a_long_chain_stays_in_loops() -> None:
    chain = some_chain(random.Random(1), LINKS_MAX + 1)
    still = [0.1] * chain.size
    assert chain.accelerations_rad_s2(still, still, still) == chain.accelerations_in_loops_rad_s2(
        still, still, still
    )


@pytest.mark.parametrize("size", [1, 2, 3, LINKS_MAX])
def test_a_written_out_step_is_the_one_in_loops_to_the_bit(size: int) -> None:
    """A spring of no stiffness in the ankle has the body take the other way."""
    dice = random.Random(size)
    chain = some_chain(dice, size)
    angles = [dice.uniform(-0.4, 0.4) for _ in range(size)]
    written_out, in_loops = (
        Body(chain, initial_angles_rad=angles, tick_s=0.001, substeps=2, fallen_below=-1.0)
        for _ in range(2)
    )
    in_loops.make_passive(0, 0.0, 0.0)
    for _ in range(50):
        torques = [0.0, *(dice.uniform(-30.0, 30.0) for _ in range(size - 1))]
        for body in (written_out, in_loops):
            body.step(torques)
        assert written_out.angles_rad == in_loops.angles_rad
        assert written_out.rates_rad_s == in_loops.rates_rad_s
