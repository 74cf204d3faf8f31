"""Bodies at random and of the paper, and what tests of them measure."""

import random
from collections.abc import Iterable, Sequence
from itertools import accumulate, combinations
from math import sin

import numpy as np

from plant_server.body.body import Body
from plant_server.body.chain import Chain
from protocol.robot.hardware import Link

SHANK = Link(10.0, 0.5, 0.25, 10.0 * 0.5**2 / 12.0)
TRUNK = Link(30.0, 0.5, 0.25, 30.0 * 0.5**2 / 12.0)
PAPER = Chain([SHANK, SHANK, TRUNK])
STILL = [0.0, 0.0, 0.0]
WEIGHT_N = 50.0 * 9.81
SIZES = (1, 2, 3, 5, 7)


def some_chain(dice: random.Random, size: int) -> Chain:
    """Links from finger to torso, their mass anywhere along them."""
    links = []
    for _ in range(size):
        mass_kg, length_m = dice.uniform(0.5, 40.0), dice.uniform(0.1, 0.8)
        inertia = mass_kg * length_m**2 / dice.uniform(6.0, 20.0)
        links.append(Link(mass_kg, length_m, length_m * dice.uniform(0.1, 1.0), inertia))
    return Chain(links)


def numbers(dice: random.Random, size: int, span: float) -> list[float]:
    return [dice.uniform(-span, span) for _ in range(size)]


def body(
    angles_rad: Sequence[float],
    *,
    chain: Chain = PAPER,
    rates_rad_s: Sequence[float] | None = None,
    braked: Iterable[int] = (),
    substeps: int = 1,
) -> Body:
    made = Body(
        chain,
        initial_angles_rad=angles_rad,
        initial_rates_rad_s=rates_rad_s,
        tick_s=1e-3,
        substeps=substeps,
    )
    for joint in braked:
        made.brake(joint)
    return made


def subsets(size: int) -> list[tuple[int, ...]]:
    return [held for count in range(size + 1) for held in combinations(range(size), count)]


def flags(braked: Iterable[int], size: int) -> list[bool]:
    held = set(braked)
    return [joint in held for joint in range(size)]


def kinetic_j(chain: Chain, angles: Sequence[float], rates: Sequence[float]) -> float:
    return 0.5 * float(np.asarray(rates) @ np.asarray(chain.mass_matrix(angles)) @ rates)


def com_x_m(chain: Chain, link: int, angles: Sequence[float]) -> float:
    """Forward position of a link's centre of mass."""
    thetas = list(accumulate(angles))
    below = zip(chain.links[:link], thetas, strict=False)
    return sum(part.length_m * sin(theta) for part, theta in below) + chain.links[link].com_m * sin(
        thetas[link]
    )


def spring_j(moving: Body, springs: Sequence[tuple[float, float]]) -> float:
    """Energy of the chain and of springs, each given by its stiffness and rest."""
    energy_j = moving.chain.energy_j(moving.angles_rad, moving.rates_rad_s)
    for angle, (stiffness, rest) in zip(moving.angles_rad, springs, strict=True):
        energy_j += 0.5 * stiffness * (angle - rest) ** 2
    return energy_j
