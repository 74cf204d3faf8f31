"""The equations of motion against another engine, and against what mechanics promises of them."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_server.body.chain import Chain
from protocol.robot.hardware import Link
from tests.plant_server.body.oracle import (
    Oracle,
    State,
    random_links,
    random_states,
    relative_error,
)

SHANK = Link(10.0, 0.5, 0.25, 10.0 * 0.5**2 / 12.0)
TRUNK = Link(30.0, 0.5, 0.25, 30.0 * 0.5**2 / 12.0)
PAPER = (SHANK, SHANK, TRUNK)


CHAINS = [PAPER, *(random_links(size, seed=size) for size in (1, 2, 7))]
each_chain = pytest.mark.parametrize("links", CHAINS, ids=lambda links: f"{len(links)}-links")


@each_chain
def test_dynamics_agree_with_mujoco(links: tuple[Link, ...]) -> None:
    """Both engines are exact but for rounding, so any term that differs is a wrong term.

    Mass matrix and bias are short sums of products of O(1) conditioning: a few 1e-15. For
    accelerations rounding is amplified by the condition number of M, up to 3e4 here, so 1e-11 is
    what can go wrong. 1e-9 leaves room for another C library and is far below any real mistake.
    """
    chain, oracle = Chain(links), Oracle(links)
    for state in random_states(chain.size, count=100):
        angles, rates, torques = state
        theirs = oracle.at(state)
        assert np.linalg.cond(theirs.mass_matrix) < 1e5
        assert relative_error(chain.mass_matrix(angles), theirs.mass_matrix) < 1e-9
        assert relative_error(chain.bias_nm(angles, rates), theirs.bias_nm) < 1e-9
        ours = chain.accelerations_rad_s2(angles, rates, torques)
        assert relative_error(ours, theirs.accelerations_rad_s2) < 1e-9


@each_chain
def test_centre_of_mass_agrees_with_mujoco(links: tuple[Link, ...]) -> None:
    """Metres and metres per second of a body of some metres: 1e-12 is a few hundred roundings."""
    chain, oracle = Chain(links), Oracle(links)
    for state in random_states(chain.size, count=20):
        angles, rates, _ = state
        theirs = oracle.at(state)
        assert np.abs(np.asarray(chain.com_m(angles)) - theirs.com_m).max() < 1e-12
        assert abs(chain.com_rise_m_s(angles, rates) - theirs.com_rise_m_s) < 1e-12


links_st = st.builds(
    lambda mass, length, com, inertia: Link(mass, length, com * length, inertia * mass * length**2),
    st.floats(0.1, 50.0),
    st.floats(0.05, 1.0),
    st.floats(0.05, 1.0),
    st.floats(0.01, 0.3),
)


@st.composite
def moving_chains(draw: st.DrawFn) -> tuple[Chain, State]:
    """A chain of one to seven links somewhere in a motion, torques on its joints."""
    chain = Chain(draw(st.lists(links_st, min_size=1, max_size=7)))

    def vector(bound: float) -> list[float]:
        numbers = st.floats(-bound, bound)
        return draw(st.lists(numbers, min_size=chain.size, max_size=chain.size))

    return chain, (vector(10.0), vector(5.0), vector(100.0))


many = settings(max_examples=60, deadline=None)


@many
@given(moving_chains())
def test_mass_matrix_is_symmetric_and_positive(moving: tuple[Chain, State]) -> None:
    """No motion is without kinetic energy.

    Symmetry holds but for the order of summation. A link's own inertia is at least 1 % of m L^2
    here, so the smallest eigenvalue stays 1e5 roundings above zero, and no tolerance is needed.
    """
    chain, (angles, _, _) = moving
    matrix = np.asarray(chain.mass_matrix(angles))
    assert np.abs(matrix - matrix.T).max() <= 1e-14 * np.abs(matrix).max()
    assert np.linalg.eigvalsh(matrix).min() > 0.0


@many
@given(moving_chains())
def test_equation_of_motion_closes(moving: tuple[Chain, State]) -> None:
    """M a + b = tau, term by term of what the chain itself reports.

    The residual of a Cholesky solve is small whatever the condition of M: 1e-12 of the largest
    term is some thousand roundings.
    """
    chain, (angles, rates, torques) = moving
    accelerations = np.asarray(chain.accelerations_rad_s2(angles, rates, torques))
    terms = np.asarray(chain.mass_matrix(angles)) * accelerations
    bias = np.asarray(chain.bias_nm(angles, rates))
    scale = max(np.abs(terms).max(), np.abs(bias).max(), np.abs(torques).max())
    residual = np.abs(terms.sum(axis=1) + bias - torques).max()
    assert residual <= 1e-12 * scale + sys.float_info.min  # Below that, numbers have fewer digits.


@many
@given(moving_chains())
def test_energy_rate_is_joint_power(moving: tuple[Chain, State]) -> None:
    """dE/dt = tau . q', along the motion that the equations give.

    A parabola through the state stands for the motion over a step h of 1e-4 of the time in which
    the motion changes. The central difference is then wrong by (1e-4)^2 and by rounding over h,
    1e-12; 1e-6 of the power that kinetic energy and motion stand for leaves room for both.
    """
    chain, (angles, rates, torques) = moving
    accelerations = chain.accelerations_rad_s2(angles, rates, torques)
    step_s = 1e-4 / (1.0 + max(map(abs, [*rates, *accelerations])))

    def energy_j(time_s: float) -> float:
        moved = [
            q + v * time_s + 0.5 * a * time_s**2
            for q, v, a in zip(angles, rates, accelerations, strict=True)
        ]
        faster = [v + a * time_s for v, a in zip(rates, accelerations, strict=True)]
        return chain.energy_j(moved, faster)

    slope_w = (energy_j(step_s) - energy_j(-step_s)) / (2.0 * step_s)
    power_w = sum(tau * rate for tau, rate in zip(torques, rates, strict=True))
    kinetic_j = chain.energy_j(angles, rates) - chain.energy_j(angles, [0.0] * chain.size)
    swing_w = (kinetic_j + 1.0) * (1.0 + max(map(abs, [*rates, *accelerations])))
    assert abs(slope_w - power_w) <= 1e-6 * swing_w


@many
@given(moving_chains())
def test_a_mirrored_body_moves_as_the_mirror_image(moving: tuple[Chain, State]) -> None:
    """Forward and backward are alike, to the bit: sine is odd, cosine even, rounding symmetric."""
    chain, (angles, rates, torques) = moving
    there = chain.accelerations_rad_s2(angles, rates, torques)
    back = chain.accelerations_rad_s2(*([-x for x in xs] for xs in (angles, rates, torques)))
    assert back == [-acceleration for acceleration in there]


@many
@given(moving_chains())
def test_time_runs_either_way(moving: tuple[Chain, State]) -> None:
    """Nothing in the body rubs: reversed rates give the same accelerations, to the bit."""
    chain, (angles, rates, torques) = moving
    forth = chain.accelerations_rad_s2(angles, rates, torques)
    assert chain.accelerations_rad_s2(angles, [-rate for rate in rates], torques) == forth


@many
@given(moving_chains(), st.floats(-3.0, 3.0))
def test_without_gravity_no_direction_is_special(
    moving: tuple[Chain, State], turn_rad: float
) -> None:
    """Turned as a whole about the ground joint, a weightless body moves alike.

    Turning costs a rounding of each angle, amplified by the condition number of M, at most 1e6
    for these links: 1e-8 of the largest acceleration.
    """
    chain, (angles, rates, torques) = moving
    chain = Chain(chain.links, gravity_m_s2=0.0)
    before = np.asarray(chain.accelerations_rad_s2(angles, rates, torques))
    turned = [angles[0] + turn_rad, *angles[1:]]
    after = np.asarray(chain.accelerations_rad_s2(turned, rates, torques))
    assert np.abs(after - before).max() <= 1e-8 * (1.0 + np.abs(before).max())


@many
@given(moving_chains())
def test_the_torques_of_the_bias_hold_the_body(moving: tuple[Chain, State]) -> None:
    """At rest under its own gravity torques a body stays; what is left is rounding through M."""
    chain, (angles, _, _) = moving
    still = [0.0] * chain.size
    accelerations = chain.accelerations_rad_s2(angles, still, chain.bias_nm(angles, still))
    fastest = max(abs(a) for a in chain.accelerations_rad_s2(angles, still, still))
    assert max(map(abs, accelerations)) <= 1e-8 * (1.0 + fastest)


@many
@given(moving_chains())
def test_the_centre_of_mass_rises_at_its_velocity(moving: tuple[Chain, State]) -> None:
    """`com_rise_m_s` is the time derivative of the height of `com_m`.

    Central difference over 2e-5 s: truncation h^2/6 times |rate|^3 (35 rad/s at the top link) is
    1e-6 m/s at most, rounding 1e-11.
    """
    chain, (angles, rates, _) = moving
    step_s = 1e-5

    def height_m(time_s: float) -> float:
        return chain.com_m([q + v * time_s for q, v in zip(angles, rates, strict=True)])[1]

    slope_m_s = (height_m(step_s) - height_m(-step_s)) / (2.0 * step_s)
    assert abs(slope_m_s - chain.com_rise_m_s(angles, rates)) < 1e-5


def test_a_single_slender_rod_is_the_textbook_pendulum() -> None:
    """q'' = (m g l/2 sin q + tau) / (m l^2 / 3): three operations, three roundings."""
    chain = Chain([TRUNK])
    mass, length = TRUNK.mass_kg, TRUNK.length_m
    expected = (mass * 9.81 * length / 2.0 * np.sin(0.3) - 7.0) / (mass * length**2 / 3.0)
    assert chain.accelerations_rad_s2([0.3], [1.7], [-7.0]) == pytest.approx([expected], rel=1e-14)


def test_a_load_on_a_locked_joint_only_matters_as_one_body() -> None:
    """Two links that turn as one behave as the one link that they make up.

    The torque at the upper joint that keeps them in line comes from the bias and the lower
    acceleration; both chains then agree to the rounding of a two by two solve.
    """
    lower, upper = SHANK, TRUNK
    mass = lower.mass_kg + upper.mass_kg
    com = (lower.mass_kg * lower.com_m + upper.mass_kg * (lower.length_m + upper.com_m)) / mass
    inertia = (
        lower.inertia_kg_m2
        + lower.mass_kg * (com - lower.com_m) ** 2
        + upper.inertia_kg_m2
        + upper.mass_kg * (lower.length_m + upper.com_m - com) ** 2
    )
    one = Chain([Link(mass, lower.length_m + upper.length_m, com, inertia)])
    two = Chain([lower, upper])
    (alpha,) = one.accelerations_rad_s2([0.4], [1.3], [25.0])
    matrix, bias = two.mass_matrix([0.4, 0.0]), two.bias_nm([0.4, 0.0], [1.3, 0.0])
    holding_nm = matrix[1][0] * alpha + bias[1]
    together = two.accelerations_rad_s2([0.4, 0.0], [1.3, 0.0], [25.0, holding_nm])
    assert together == pytest.approx([alpha, 0.0], abs=1e-12 * abs(alpha))
