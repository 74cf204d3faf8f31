"""Joints that are braked, passive or limp, and pushes: what mechanics promises of each."""

import random
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, nan, pi, sin

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant_server.body.chain import Chain
from protocol.robot.hardware import Link
from tests.plant_server.body.bodies import (
    PAPER,
    SHANK,
    SIZES,
    STILL,
    TRUNK,
    WEIGHT_N,
    body,
    flags,
    kinetic_j,
    numbers,
    some_chain,
    spring_j,
    subsets,
)


def mujoco_accelerations(
    chain: Chain,
    state: tuple[list[float], list[float], list[float], list[float]],
    braked: Sequence[bool],
) -> list[float]:
    """The accelerations of the free joints; in MuJoCo braked ones do not exist."""
    angles, rates, torques, forces = state
    xml = ""
    for i in range(chain.size - 1, -1, -1):
        link = chain.links[i]
        height = chain.links[i - 1].length_m if i else 0.0
        joint = "" if braked[i] else '<joint type="hinge" axis="0 1 0"/>'
        turn = repr(angles[i]) if braked[i] else "0"
        inertia = " ".join([repr(link.inertia_kg_m2)] * 3)
        xml = (
            f'<body pos="0 0 {height!r}" euler="0 {turn} 0">{joint}<inertial '
            f'pos="0 0 {link.com_m!r}" mass="{link.mass_kg!r}" diaginertia="{inertia}"/>'
            f"{xml}</body>"
        )
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/>'
        f"<worldbody>{xml}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    free = [i for i in range(chain.size) if not braked[i]]
    data.qpos[:] = [angles[i] for i in free]
    data.qvel[:] = [rates[i] for i in free]
    data.qfrc_applied[:] = [torques[i] for i in free]
    data.xfrc_applied[1:, 0] = forces
    mujoco.mj_forward(model, data)
    found: list[float] = data.qacc.tolist()
    return found


# Brakes: the motion that remains.


@pytest.mark.parametrize("size", SIZES)
def test_braked_and_pushed_accelerations_agree_with_mujoco(size: int) -> None:
    """Any brakes, any state, a push on every link; in MuJoCo braked links are welded.

    Both are exact but for rounding, amplified by the condition number of M (some 1e4): 1e-9 is
    far above that, and far below any wrong term.
    """
    dice = random.Random(size)
    for _ in range(30):
        chain = some_chain(dice, size)
        held = [dice.random() < 0.4 for _ in range(size)]
        held[dice.randrange(size)] = False
        angles, torques, forces = (numbers(dice, size, span) for span in (pi, 200.0, 300.0))
        rates = [0.0 if h else dice.uniform(-5.0, 5.0) for h in held]
        pushes = chain.push_torques_nm(angles, forces)
        acting = [tau + push for tau, push in zip(torques, pushes, strict=True)]
        ours = chain.braked_accelerations_rad_s2(angles, rates, acting, held)
        assert [a for a, h in zip(ours, held, strict=True) if h] == [0.0] * sum(held)
        theirs = mujoco_accelerations(chain, (angles, rates, torques, forces), held)
        free = [a for a, h in zip(ours, held, strict=True) if not h]
        assert free == pytest.approx(theirs, abs=1e-9 * max(map(abs, theirs)))


@pytest.mark.parametrize("size", SIZES)
def test_without_a_brake_the_equations_are_the_same_to_the_bit(size: int) -> None:
    dice = random.Random(100 + size)
    for _ in range(20):
        chain = some_chain(dice, size)
        angles, rates, torques = (numbers(dice, size, span) for span in (pi, 5.0, 200.0))
        free = chain.braked_accelerations_rad_s2(angles, rates, torques, [False] * size)
        assert free == chain.accelerations_in_loops_rad_s2(angles, rates, torques)


@pytest.mark.parametrize("size", SIZES)
def test_a_braked_joint_does_not_move_at_all(size: int) -> None:
    """S17: the same float for its angle and 0.0 for its rate, whatever acts, from any motion."""
    dice = random.Random(200 + size)
    for _ in range(10):
        chain = some_chain(dice, size)
        moving = body(numbers(dice, size, 0.3), chain=chain, rates_rad_s=numbers(dice, size, 1.0))
        moving.step(numbers(dice, size, 50.0))
        held = dice.sample(range(size), dice.randint(1, size))
        for joint in held:
            moving.brake(joint)
        angles = [moving.angles_rad[joint] for joint in held]
        for _ in range(50):
            moving.forces_n = numbers(dice, size, 100.0)
            moving.step(numbers(dice, size, 100.0))
            assert [moving.angles_rad[joint] for joint in held] == angles
            assert [moving.rates_rad_s[joint] for joint in held] == [0.0] * len(held)


@pytest.mark.parametrize("braked", [held for held in subsets(3) if len(held) in (1, 2)])
def test_a_braked_swing_keeps_its_energy(braked: tuple[int, ...]) -> None:
    """Five seconds near hanging by the default step, to 1e-9 of what swings (`test_body.py`)."""
    swinging = body([pi + 0.3, 0.2, -0.3], braked=braked)
    totals, potentials = [], []
    for _ in range(5000):
        swinging.step(STILL)
        totals.append(PAPER.energy_j(swinging.angles_rad, swinging.rates_rad_s))
        potentials.append(PAPER.energy_j(swinging.angles_rad, STILL))
    assert np.ptp(totals) < 1e-9 * np.ptp(potentials)


def joined(lower: Link, upper: Link, bend_rad: float) -> tuple[Link, float]:
    """The one link that two make up, and its lean against the lower one (parallel axes)."""
    mass = lower.mass_kg + upper.mass_kg
    x_m = upper.mass_kg * upper.com_m * sin(bend_rad) / mass
    up_m = (
        lower.mass_kg * lower.com_m + upper.mass_kg * (lower.length_m + upper.com_m * cos(bend_rad))
    ) / mass
    upper_x_m = upper.com_m * sin(bend_rad)
    upper_up_m = lower.length_m + upper.com_m * cos(bend_rad)
    inertia = (
        lower.inertia_kg_m2
        + lower.mass_kg * (x_m**2 + (up_m - lower.com_m) ** 2)
        + upper.inertia_kg_m2
        + upper.mass_kg * ((upper_x_m - x_m) ** 2 + (upper_up_m - up_m) ** 2)
    )
    length_m = lower.length_m + upper.length_m
    return Link(mass, length_m, hypot(x_m, up_m), inertia), atan2(x_m, up_m)


@pytest.mark.parametrize("size", [2, 3, 5, 7])
@pytest.mark.parametrize("where", ["straight", "bent at the top"])
def test_a_braked_joint_makes_two_links_one(size: int, where: str) -> None:
    """Torques included, to 1e-12 of the largest acceleration.

    A bent pair has its centre of mass beside the link, so only the top pair is a link of the
    kind that a chain is made of; a straight pair is one anywhere. Both solutions are rounded by
    the condition number of M, so links are alike here (1e2 to 1e3).
    """
    dice = random.Random(300 + size)
    for _ in range(30):
        alike = [
            Link(m, 0.4, 0.2 * dice.uniform(0.8, 1.2), m * 0.4**2 / 12.0)
            for m in (dice.uniform(5.0, 15.0) for _ in range(size))
        ]
        straight = where == "straight"
        joint = dice.randrange(1, size) if straight else size - 1
        bend_rad = 0.0 if straight else dice.uniform(-pi, pi)
        one, lean_rad = joined(alike[joint - 1], alike[joint], bend_rad)
        two, merged = Chain(alike), Chain([*alike[: joint - 1], one, *alike[joint + 1 :]])
        angles, rates, torques = (numbers(dice, size, span) for span in (pi, 3.0, 50.0))
        angles[joint], rates[joint] = bend_rad, 0.0
        fewer = [[x for i, x in enumerate(xs) if i != joint] for xs in (angles, rates, torques)]
        fewer[0][joint - 1] += lean_rad
        expected = merged.accelerations_rad_s2(*fewer)
        expected.insert(joint, 0.0)
        found = two.braked_accelerations_rad_s2(angles, rates, torques, flags([joint], size))
        assert found == pytest.approx(expected, abs=1e-12 * max(map(abs, expected)))


def test_a_braked_ankle_makes_the_knee_the_ground_joint() -> None:
    """What is above swings about a knee that stands: the chain of the upper links, turned."""
    upper = Chain([SHANK, TRUNK])
    there, here = body([0.4, 2.5, 0.3], braked=[0]), body([2.9, 0.3], chain=upper)
    for _ in range(1000):
        there.step([3.0, -2.0, 1.0])
        here.step([-2.0, 1.0])
    assert there.angles_rad == pytest.approx([0.4, here.angles_rad[0] - 0.4, here.angles_rad[1]])
    assert there.rates_rad_s == pytest.approx([0.0, *here.rates_rad_s], rel=1e-9)


def test_a_body_with_all_joints_braked_stands_still() -> None:
    """Whatever acts; and the plate feels its weight, where its moments balance.

    The moment about the ankle is weight times lever plus push times height; statics of 500 N m
    to a few roundings.
    """
    angles = [0.1, -0.2, 0.4]
    standing = body(angles, braked=[2, 0, 1])
    standing.forces_n = [0.0, 0.0, 80.0]
    for _ in range(100):
        standing.step([300.0, -200.0, 100.0])
    assert (standing.angles_rad, standing.rates_rad_s) == (angles, STILL)
    assert standing.torques_nm == STILL
    assert standing.foot_force_n == WEIGHT_N
    height_m = 0.5 * cos(0.1) + 0.5 * cos(-0.1) + 0.25 * cos(0.3)
    lever_m = PAPER.com_m(angles)[0] + 80.0 * height_m / WEIGHT_N
    assert standing.foot_cop_m == pytest.approx(lever_m, rel=1e-12)


# Brakes: the impact.


@pytest.mark.parametrize("size", SIZES)
def test_the_impact_keeps_the_momenta_of_the_free_joints(size: int) -> None:
    """M (q'+ - q'-) has entries at brakes only, and the energy told is the energy lost.

    Momenta to 1e-12 of the largest; energy to 1e-12 of that before: both sums of a few products,
    the new rates amplified by the condition number only in directions without energy.
    """
    dice = random.Random(400 + size)
    for _ in range(50):
        chain = some_chain(dice, size)
        angles, rates = numbers(dice, size, pi), numbers(dice, size, 5.0)
        moving = body(angles, chain=chain, rates_rad_s=rates)
        held: list[int] = []
        for joint in dice.sample(range(size), dice.randint(1, size)):
            before, before_j = moving.rates_rad_s, kinetic_j(chain, angles, moving.rates_rad_s)
            lost_j = moving.brake(joint)
            held.append(joint)
            assert lost_j >= 0.0
            after_j = kinetic_j(chain, angles, moving.rates_rad_s)
            assert abs(before_j - after_j - lost_j) <= 1e-12 * before_j
            matrix = np.asarray(chain.mass_matrix(angles))
            momenta, impulses = matrix @ before, matrix @ np.subtract(moving.rates_rad_s, before)
            free = [i for i in range(size) if i not in held]
            assert np.abs(impulses[free]).max(initial=0.0) <= 1e-12 * np.abs(momenta).max()
            assert [moving.rates_rad_s[i] for i in held] == [0.0] * len(held)
        assert moving.angles_rad == angles


@pytest.mark.parametrize("size", [2, 3, 5, 7])
def test_brakes_close_in_any_order(size: int) -> None:
    """Projections onto shrinking spaces end in the smallest; their losses add up (Pythagoras)."""
    dice = random.Random(500 + size)
    for _ in range(50):
        chain = some_chain(dice, size)
        angles, rates = numbers(dice, size, pi), numbers(dice, size, 5.0)
        joints = dice.sample(range(size), dice.randint(2, size))
        there, back = (body(angles, chain=chain, rates_rad_s=rates) for _ in range(2))
        lost_j = sum(there.brake(joint) for joint in joints)
        assert sum(back.brake(joint) for joint in reversed(joints)) == pytest.approx(
            lost_j, rel=1e-11
        )
        scale = 1e-10 * max(map(abs, rates))
        assert back.rates_rad_s == pytest.approx(there.rates_rad_s, abs=scale)


def test_a_single_pendulum_loses_all_it_has() -> None:
    """m l^2/3 q'^2/2 of a slender rod."""
    rod = body([0.3], chain=Chain([TRUNK]), rates_rad_s=[2.0])
    assert rod.brake(0) == pytest.approx(30.0 * 0.5**2 / 3.0 * 2.0**2 / 2.0, rel=1e-15)


def test_a_brake_on_a_brake_loses_nothing() -> None:
    moving = body([0.1, 0.2, 0.3], rates_rad_s=[1.0, -2.0, 0.5])
    assert moving.brake(1) > 0.0
    rates = list(moving.rates_rad_s)
    assert moving.brake(1) == 0.0
    assert moving.rates_rad_s == rates
    for _ in range(10):
        moving.step(STILL)
        assert moving.brake(1) == 0.0


def test_released_joints_keep_their_rates_and_are_driven_again() -> None:
    """S17. A body that was braked and released is one that starts there, to the bit."""
    moving = body([0.1, 0.2, -0.3], rates_rad_s=[0.5, -1.0, 2.0])
    moving.brake(0)
    moving.make_passive(2, 100.0, 5.0)
    moving.forces_n = [0.0, 30.0, 0.0]
    for _ in range(20):
        moving.step(STILL)
    moving.forces_n = [0.0] * 3
    angles, rates = list(moving.angles_rad), list(moving.rates_rad_s)
    moving.release(0)
    moving.release(2)
    assert (moving.angles_rad, moving.rates_rad_s) == (angles, rates)
    fresh = body(angles, rates_rad_s=rates)
    for _ in range(50):
        for each in (moving, fresh):
            each.step([10.0, -5.0, 3.0])
        assert moving.angles_rad == fresh.angles_rad
        assert moving.rates_rad_s == fresh.rates_rad_s
        assert moving.torques_nm == fresh.torques_nm == [10.0, -5.0, 3.0]
    assert (moving.foot_force_n, moving.foot_cop_m) == (fresh.foot_force_n, fresh.foot_cop_m)


def test_the_plate_feels_the_impact() -> None:
    """Newton's law holds through it: the force integrated once is the momentum, exactly.

    Velocities of 1 m/s from 200 forces of up to 1e5 N (the impact) times 1 ms / 50 kg: 1e-12.
    """
    falling = body([0.1, -0.2, 0.3], rates_rad_s=[0.5, -2.0, 1.0])
    momentum_m_s = PAPER.com_rise_m_s(falling.angles_rad, falling.rates_rad_s)
    for tick in range(200):
        if tick == 100:
            assert falling.brake(1) > 1.0
        if tick == 150:
            falling.release(1)
        falling.step([-40.0, 20.0, -10.0])
        momentum_m_s += 1e-3 * (falling.foot_force_n / 50.0 - 9.81)
    assert not falling.fallen
    rise_m_s = PAPER.com_rise_m_s(falling.angles_rad, falling.rates_rad_s)
    assert abs(momentum_m_s - rise_m_s) < 1e-12


def angular_momentum(angles: Sequence[float], rates: Sequence[float]) -> float:
    """About the ankle: what is conjugate to the ankle's angle."""
    return float((np.asarray(PAPER.mass_matrix(angles)) @ rates)[0])


@pytest.mark.parametrize("released", [False, True])
def test_the_plate_bears_the_moment_of_the_ankle_brake(released: bool) -> None:
    """Euler's law about the ankle: dL/dt = m g x + F h + ankle torque, the impact included.

    The ankle is braked in the middle of a fall. Moments are those at the starts of ticks, so the
    sum is wrong by h/2 of their change from start to end, some 100 N m: 0.05 N m s. What is
    summed is 11 N m s, and the impact alone is 21 N m s.
    """
    falling = body([0.1, -0.2, 0.3], rates_rad_s=[1.0, 0.5, 1.0])
    falling.forces_n = [0.0, 0.0, -20.0]
    start = angular_momentum(falling.angles_rad, falling.rates_rad_s)
    gained = 0.0
    for tick in range(200):
        if tick == 100:
            falling.brake(0)
            if released:
                falling.release(0)
        x_m = PAPER.com_m(falling.angles_rad)[0]
        turning_nm = WEIGHT_N * x_m + PAPER.push_torques_nm(falling.angles_rad, falling.forces_n)[0]
        falling.step([-30.0, 20.0, -60.0])
        gained += 1e-3 * (turning_nm + falling._ankle_nm)
        if falling.foot_force_n > 0.0:
            moment_nm = falling.foot_cop_m * falling.foot_force_n
            assert moment_nm == pytest.approx(-falling._ankle_nm, rel=1e-14)
    assert not falling.fallen
    change = angular_momentum(falling.angles_rad, falling.rates_rad_s) - start
    assert abs(gained - change) < 0.1


# Springs and dampers.


START, RATES = [pi + 0.3, 0.2, -0.1], [0.5, -1.0, 1.5]
STIFF = [50.0, 30.0, 20.0]


def test_springs_without_dampers_keep_the_energy() -> None:
    """Kinetic, potential and elastic, to 1e-9 of what turns from one into another."""
    swinging = body(START, rates_rad_s=RATES)
    for joint in range(3):
        swinging.make_passive(joint, STIFF[joint], 0.0)
    springs = list(zip(STIFF, START, strict=True))
    totals, kinetics = [], []
    for _ in range(5000):
        swinging.step([9.0, 9.0, 9.0])
        totals.append(spring_j(swinging, springs))
        kinetics.append(kinetic_j(PAPER, swinging.angles_rad, swinging.rates_rad_s))
    assert np.ptp(totals) < 1e-9 * np.ptp(kinetics)


def test_a_damper_takes_energy_in_every_tick() -> None:
    """Never is any gained, beyond 1e-12 of 400 J, and what is lost is the power of the dampers.

    The trapezium rule for the sum of d q'^2 over a second is good to (20 rad/s h)^2 / 12: 3e-5.
    """
    swinging = body(START, rates_rad_s=RATES)
    for joint in range(3):
        swinging.make_passive(joint, STIFF[joint], 3.0)
    springs = list(zip(STIFF, START, strict=True))
    energies, powers = [], []
    for _ in range(8001):
        energies.append(spring_j(swinging, springs))
        powers.append(3.0 * sum(rate**2 for rate in swinging.rates_rad_s))
        swinging.step(STILL)
    assert all(after <= before + 1e-12 * 400.0 for before, after in pairwise(energies))
    lost_j = energies[0] - energies[-1]
    assert lost_j > 10.0
    assert lost_j == pytest.approx(1e-3 * float(np.trapezoid(powers)), rel=3e-5)


def by_eighth_order(
    angles: Sequence[float], rates: Sequence[float], joints: str, forces: list[float]
) -> NDArray[np.float64]:
    """The state after a second, by DOP853 on M q'' + b = tau, written with numpy."""
    free = [i for i, mode in enumerate(joints) if mode != "b"]
    rest = list(angles)

    def slope(_: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        q, v = state[:3], state[3:]
        thetas = np.cumsum(q)
        lengths = [link.length_m for link in PAPER.links]
        torques = -np.asarray(PAPER.bias_nm(q.tolist(), v.tolist()))
        for i, mode in enumerate(joints):
            torques[i] += -STIFF[i] * (q[i] - rest[i]) - 2.0 * v[i] if mode == "p" else 5.0
            for k, force in enumerate(forces):  # The height of a push above the joint.
                if k >= i:
                    levers = [length * cos(a) for length, a in zip(lengths, thetas, strict=True)]
                    height = sum(levers[i:k]) + PAPER.links[k].com_m * cos(thetas[k])
                    torques[i] += force * height
        accelerations = np.zeros(3)
        matrix = np.asarray(PAPER.mass_matrix(q.tolist()))
        accelerations[free] = np.linalg.solve(matrix[np.ix_(free, free)], torques[free])
        return np.concatenate([v, accelerations])

    end = solve_ivp(
        slope, (0.0, 1.0), [*angles, *rates], method="DOP853", rtol=1e-13, atol=1e-14
    ).y[:, -1]
    return np.asarray(end, dtype=np.float64)


@pytest.mark.parametrize("joints", ["ppp", "dpd", "dbp", "bpd", "pdb", "bpb", "pbb", "ddd"])
def test_a_second_in_any_mode_is_the_true_motion(joints: str) -> None:
    """d driven by 5 N m, b braked, p passive, all pushed: to 1e-9 of an eighth order solution.

    RK4 in steps of 0.25 ms: (20 rad/s h)^4 of a motion of a radian is 6e-10, times 1/120.
    """
    forces = [3.0, -8.0, 15.0]
    rates = [0.0 if mode == "b" else rate for mode, rate in zip(joints, RATES, strict=True)]
    moving = body(START, rates_rad_s=rates, substeps=4)
    moving.forces_n = forces
    for joint, mode in enumerate(joints):
        if mode == "p":
            moving.make_passive(joint, STIFF[joint], 2.0)
        elif mode == "b":
            assert moving.brake(joint) == 0.0
    for _ in range(1000):
        moving.step([5.0, 5.0, 5.0])
    truth = by_eighth_order(START, rates, joints, forces)
    assert [*moving.angles_rad, *moving.rates_rad_s] == pytest.approx(truth.tolist(), abs=1e-9)


def test_the_torque_sensor_shows_the_motor_or_the_spring_but_not_the_brake() -> None:
    """At the start of the tick; a passive joint does not hear its board."""
    moving = body([0.1, 0.2, 0.3], rates_rad_s=[0.0, 1.0, 0.0])
    moving.make_passive(1, 100.0, 5.0)
    moving.brake(2)
    rest_rad = moving.angles_rad[1]
    for _ in range(5):
        spring_nm = -100.0 * (moving.angles_rad[1] - rest_rad) - 5.0 * moving.rates_rad_s[1]
        moving.step([7.0, 70.0, 700.0])
        assert moving.torques_nm == [7.0, spring_nm, 0.0]


# Pushes.


def test_a_locked_body_does_not_feel_pushes_brakes_or_springs() -> None:
    """S8: nothing moves it, and its sensors feel nothing of it."""
    locked = body([0.1, 0.2, 0.3])
    locked.locked = True
    locked.forces_n = [500.0, 500.0, 500.0]
    assert locked.brake(0) == 0.0
    locked.make_passive(1, 100.0, 1.0)
    for _ in range(10):
        locked.step([500.0, -500.0, 500.0])
    assert (locked.angles_rad, locked.rates_rad_s) == ([0.1, 0.2, 0.3], STILL)
    assert (locked.torques_nm, locked.foot_force_n) == (STILL, WEIGHT_N)


@pytest.mark.parametrize("number", [nan, float("inf"), 1e308])
def test_what_cannot_be_computed_is_a_fall(number: float) -> None:
    """S21: a brake or a push in a body that flies apart ends the run instead of raising in it."""
    for joint in range(3):
        braked, pushed = body([0.1, 0.2, 0.3]), body([0.1, 0.2, 0.3])
        braked.rates_rad_s[joint] = number
        braked.angles_rad[1] = number
        assert braked.brake(joint) == 0.0
        braked.step(STILL)
        assert braked.fallen
        pushed.forces_n[joint] = number
        pushed.step(STILL)
        pushed.step(STILL)
        assert pushed.fallen


def test_a_link_without_inertia_cannot_be_braked() -> None:
    """Nothing resists the lower joint, so its impact cannot be computed."""
    links = (Link(1e-170, 0.5, 0.25, 0.0), Link(1e-170, 0.5, 0.25, 0.0))
    nothing = body([0.1, 0.2], chain=Chain(links), rates_rad_s=[1e-200, 1e-200])
    nothing.brake(1)
    nothing.step([1.0, 1.0])
    assert nothing.fallen
