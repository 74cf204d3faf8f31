"""The long chain: the same mechanics as `Chain`, for a price that is linear in its links."""

from math import pi

import numpy as np
import pytest

from plant_server.body.articulated import LongChain, chain_of
from plant_server.body.body import Body
from plant_server.body.chain import Chain
from plant_server.body.unrolled import LINKS_MAX
from tests.plant_server.body.oracle import Oracle, random_links, random_states, relative_error
from tests.work import lines_run

TOLERANCE = 1e-9
"""Of the largest entry. Both forms are exact but for rounding, which the condition number of the
mass matrix amplifies (up to 1e6 for 50 links); what is seen is below 1e-11. A wrong term is not."""


def pair(size: int) -> tuple[Chain, LongChain]:
    links = random_links(size, seed=size)
    return Chain(links), LongChain(links)


def some_held(size: int, seed: int) -> list[bool]:
    return [bool(held) for held in np.random.default_rng([size, seed]).integers(0, 2, size)]


def agree(ours: list[float], theirs: list[float]) -> bool:
    scale = max(map(abs, theirs))
    return all(abs(a - b) <= TOLERANCE * scale for a, b in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("size", range(1, 51))
def test_it_moves_as_the_mass_matrix_says(size: int) -> None:
    dense, long = pair(size)
    for angles, rates, torques in random_states(size, count=5):
        theirs = dense.accelerations_in_loops_rad_s2(angles, rates, torques)
        assert agree(long.accelerations_rad_s2(angles, rates, torques), theirs)
        assert agree(long.bias_nm(angles, rates), dense.bias_nm(angles, rates))
        assert agree(
            long.inverse_nm(angles, rates, torques), dense.inverse_nm(angles, rates, torques)
        )
        assert agree(long.impulses_nms(angles, rates), dense.impulses_nms(angles, rates))


@pytest.mark.parametrize("size", range(1, 51))
def test_brakes_hold_it_as_they_hold_the_mass_matrix(size: int) -> None:
    """And what they hold does not move at all."""
    dense, long = pair(size)
    for seed, (angles, rates, torques) in enumerate(random_states(size, count=5)):
        held = some_held(size, seed)
        after = long.braked_rates_rad_s(angles, rates, held)
        assert agree(after, dense.braked_rates_rad_s(angles, rates, held))
        turning = long.braked_accelerations_rad_s2(angles, after, torques, held)
        theirs = dense.braked_accelerations_rad_s2(angles, after, torques, held)
        assert agree(turning, theirs)
        for joint in (joint for joint in range(size) if held[joint]):
            assert (after[joint], turning[joint]) == (0.0, 0.0)


@pytest.mark.parametrize("size", [1, 9, 20, 50])
def test_it_moves_as_mujoco_says(size: int) -> None:
    links = random_links(size, seed=size)
    long, oracle = LongChain(links), Oracle(links)
    for state in random_states(size, count=20):
        angles, rates, torques = state
        theirs = oracle.at(state)
        ours = long.accelerations_rad_s2(angles, rates, torques)
        assert relative_error(ours, theirs.accelerations_rad_s2) < TOLERANCE
        assert relative_error(long.bias_nm(angles, rates), theirs.bias_nm) < TOLERANCE


@pytest.mark.parametrize("size", [1, 9, 30])
def test_without_a_brake_nothing_is_joined(size: int) -> None:
    long = LongChain(random_links(size, seed=size))
    for angles, rates, torques in random_states(size, count=5):
        free = long.braked_accelerations_rad_s2(angles, rates, torques, [False] * size)
        assert free == long.accelerations_rad_s2(angles, rates, torques)


@pytest.mark.parametrize("size", [2, 9, 30])
def test_a_mirrored_long_chain_moves_as_the_mirror_image(size: int) -> None:
    """To the bit, and so does time reversed: rounding takes no side."""
    long = LongChain(random_links(size, seed=size))
    for angles, rates, torques in random_states(size, count=5):
        there = long.accelerations_rad_s2(angles, rates, torques)
        back = long.accelerations_rad_s2(*([-x for x in xs] for xs in (angles, rates, torques)))
        assert back == [-acceleration for acceleration in there]
        assert long.accelerations_rad_s2(angles, [-rate for rate in rates], torques) == there


@pytest.mark.parametrize("held", [(), (0,), (4, 5, 6), (0, 1, 11)])
def test_a_long_swing_keeps_its_energy(held: tuple[int, ...]) -> None:
    """Two seconds near hanging, in steps of 1 ms: to 1e-7 of what swings.

    A chain has faster modes than three links, up to 100 rad/s here, of which RK4 loses
    (w h)^6/72 a step, 1e-8 of what little they hold.
    """
    size = 12
    chain = LongChain(random_links(size, seed=3))
    rng = np.random.default_rng(7)
    start = [pi + 0.2, *rng.uniform(-0.1, 0.1, size - 1).tolist()]
    swinging = Body(chain, initial_angles_rad=start, tick_s=1e-3, substeps=1, fallen_below=-2.0)
    for joint in held:
        swinging.brake(joint)
    totals, potentials = [], []
    for _ in range(2000):
        swinging.step([0.0] * size)
        totals.append(chain.energy_j(swinging.angles_rad, swinging.rates_rad_s))
        potentials.append(chain.energy_j(swinging.angles_rad, [0.0] * size))
    assert [swinging.angles_rad[joint] for joint in held] == [start[joint] for joint in held]
    assert np.ptp(potentials) > 1.0
    assert np.ptp(totals) < 1e-7 * np.ptp(potentials)


def test_the_work_grows_with_the_links() -> None:
    """Twice the links, twice the lines that run."""

    def work(size: int) -> int:
        long = LongChain(random_links(size, seed=1))
        ((angles, rates, torques),) = random_states(size, count=1)
        held = [True, False] * (size // 2)
        return lines_run(
            lambda: (
                long.accelerations_rad_s2(angles, rates, torques),
                long.braked_accelerations_rad_s2(angles, rates, torques, held),
                long.braked_rates_rad_s(angles, rates, held),
                long.inverse_nm(angles, rates, torques),
            )
        )

    first, second, third = work(16), work(32), work(64)
    assert third - second == 2 * (second - first)


def test_a_chain_is_of_the_kind_that_is_faster() -> None:
    assert type(chain_of(random_links(LINKS_MAX, seed=1))) is Chain
    assert type(chain_of(random_links(LINKS_MAX + 1, seed=1))) is LongChain
