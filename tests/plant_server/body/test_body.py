"""The fixed step, and what the body shows of itself: its fall, its foot, its lock."""

from itertools import pairwise
from math import inf, nan, pi, radians

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant_server.body.body import Body
from plant_server.body.chain import Chain
from protocol.robot.hardware import Link

SHANK = Link(10.0, 0.5, 0.25, 10.0 * 0.5**2 / 12.0)
TRUNK = Link(30.0, 0.5, 0.25, 30.0 * 0.5**2 / 12.0)
PAPER = Chain([SHANK, SHANK, TRUNK])
STILL = [0.0, 0.0, 0.0]
WEIGHT_N = 50.0 * 9.81


def body(
    angles_rad: list[float],
    *,
    chain: Chain = PAPER,
    rates_rad_s: list[float] | None = None,
    tick_s: float = 1e-3,
    substeps: int = 1,
) -> Body:
    return Body(
        chain,
        initial_angles_rad=angles_rad,
        initial_rates_rad_s=rates_rad_s,
        tick_s=tick_s,
        substeps=substeps,
    )


def test_a_free_swing_keeps_its_energy() -> None:
    """Ten seconds from 10 degrees beside hanging, by the default step, to 1e-9 of the range.

    The range is what the swing turns from potential into kinetic energy and back (7 J of 380 J),
    the only part of the energy that means anything. Of a mode of frequency w, RK4 loses (w h)^6/72
    a step: for the swing's 4 rad/s that is less than a rounding, and for the fastest mode (some
    20 rad/s, hardly excited) 1e-12. Over 10,000 steps 1e-9 is a bound with room; the angle of the
    swing is not to be seen in it.
    """
    swinging = body([pi + radians(10.0), 0.0, 0.0])
    totals, potentials = [], []
    for _ in range(10_000):
        swinging.step(STILL)
        totals.append(PAPER.energy_j(swinging.angles_rad, swinging.rates_rad_s))
        potentials.append(PAPER.energy_j(swinging.angles_rad, STILL))
    assert np.ptp(totals) < 1e-9 * np.ptp(potentials)


def test_constant_torques_do_work() -> None:
    """The energy gained is tau . (q_end - q_start), for constant torques exactly.

    What remains is the step's error: 1e-9 of the work, as in the free swing.
    """
    torques = [12.0, -7.0, 4.0]
    pushed = body([pi, 0.0, 0.0])
    start = list(pushed.angles_rad)
    before_j = PAPER.energy_j(pushed.angles_rad, pushed.rates_rad_s)
    work_j = []
    for _ in range(2000):
        pushed.step(torques)
        turned = zip(torques, pushed.angles_rad, start, strict=True)
        work_j.append(sum(tau * (q - q0) for tau, q, q0 in turned))
    gained_j = PAPER.energy_j(pushed.angles_rad, pushed.rates_rad_s) - before_j
    assert abs(gained_j - work_j[-1]) < 1e-9 * max(map(abs, work_j))


def reference(start: list[float], torques: list[float], duration_s: float) -> NDArray[np.float64]:
    """The state after constant torques, by an adaptive method of eighth order."""

    def slope(_: float, state: NDArray[np.float64]) -> list[float]:
        angles, rates = state[:3].tolist(), state[3:].tolist()
        return [*rates, *PAPER.accelerations_rad_s2(angles, rates, torques)]

    solution = solve_ivp(
        slope, (0.0, duration_s), [*start, *STILL], method="DOP853", rtol=1e-13, atol=1e-15
    )
    return np.asarray(solution.y[:, -1], dtype=np.float64)


def test_the_step_is_of_fourth_order() -> None:
    """The error after 1 s falls sixteenfold, within 20 %, whenever the step halves.

    Steps of 1/64 to 1/2048 s, binary so that each is exact, in a swing whose fastest mode takes
    20 of the longest steps: all in the asymptotic regime. The errors are 1e-3 to 1e-9, far above
    the 1e-12 where the reference itself and rounding begin to show.
    """
    start, torques = [pi + 0.3, 0.2, -0.1], [5.0, -3.0, 2.0]
    truth = reference(start, torques, 1.0)
    errors = []
    for substeps in (1, 2, 4, 8, 16, 32):
        moving = body(start, tick_s=1.0 / 64.0, substeps=substeps)
        for _ in range(64):
            moving.step(torques)
        state = np.array([*moving.angles_rad, *moving.rates_rad_s])
        errors.append(float(np.abs(state - truth).max()))
    ratios = [coarse / fine for coarse, fine in pairwise(errors) if fine > 1e-12]
    assert len(ratios) >= 2
    assert ratios == pytest.approx([16.0] * len(ratios), rel=0.2)


def test_substeps_are_shorter_ticks_under_the_same_torque() -> None:
    """One tick of four substeps is four ticks of a quarter, to the bit (the quarter is exact)."""
    torques = [-20.0, 10.0, 5.0]
    one, four = body([0.1, 0.2, -0.3], substeps=4), body([0.1, 0.2, -0.3], tick_s=1e-3 / 4.0)
    one.step(torques)
    for _ in range(4):
        four.step(torques)
    assert (one.angles_rad, one.rates_rad_s) == (four.angles_rad, four.rates_rad_s)


def test_a_mirrored_run_is_the_mirror_image() -> None:
    """Half a second of falling, forward and backward, bit for bit."""
    there, back = body([0.1, -0.2, 0.3]), body([-0.1, 0.2, -0.3])
    for tick in range(500):
        torques = [20.0 * np.sin(0.01 * tick).item(), -5.0, 3.0]
        there.step(torques)
        back.step([-torque for torque in torques])
    assert back.angles_rad == [-angle for angle in there.angles_rad]
    assert back.rates_rad_s == [-rate for rate in there.rates_rad_s]
    assert back.foot_force_n == there.foot_force_n
    assert back.foot_cop_m == -there.foot_cop_m


def test_a_locked_body_does_not_move() -> None:
    """Whatever acts on it (S8): and its torque sensors and foot feel nothing of it."""
    locked = body([0.1, 0.2, 0.3])
    locked.locked = True
    for _ in range(10):
        locked.step([500.0, -500.0, 500.0])
    assert locked.angles_rad == [0.1, 0.2, 0.3]
    assert locked.rates_rad_s == STILL
    assert locked.torques_nm == STILL
    assert locked.foot_force_n == WEIGHT_N


@pytest.mark.parametrize("size", [1, 2, 3, 7])
def test_any_number_of_links_stands_upright(size: int) -> None:
    """Straight up nothing pulls: sin 0 is 0, so the equilibrium is exact, and the foot feels
    the weight, to the bit."""
    chain = Chain([SHANK] * size)
    standing = body([0.0] * size, chain=chain)
    for _ in range(100):
        standing.step([0.0] * size)
    assert standing.angles_rad == [0.0] * size
    assert standing.rates_rad_s == [0.0] * size
    assert standing.foot_force_n == chain.mass_kg * 9.81
    assert standing.foot_cop_m == 0.0
    assert not standing.fallen


def test_a_body_at_rest_puts_its_weight_under_its_centre_of_mass() -> None:
    """Statics: the foot feels the weight, at the place below the centre of mass.

    The torques that hold the posture are rounded, so after the tick the body creeps at about
    1e-16 m/s: over 1 ms that is 1e-12 N of 490 N, and 1e-14 m.
    """
    leaning = body([0.1, -0.2, 0.4])
    leaning.step(PAPER.bias_nm([0.1, -0.2, 0.4], STILL))
    assert leaning.foot_force_n == pytest.approx(WEIGHT_N, rel=1e-12)
    assert leaning.foot_cop_m == pytest.approx(PAPER.com_m([0.1, -0.2, 0.4])[0], abs=1e-12)


def test_the_force_plate_integrated_twice_is_the_height() -> None:
    """Newton's law for the whole body: m y'' = F - m g.

    Forces are means over ticks, so velocities are exact; the trapezium rule for the height is
    wrong by h^2/12 times the change of the acceleration, which here is some 15 m/s^2: 1.2e-6 m.
    """
    falling = body([0.1, -0.2, 0.3])
    height_m, rise_m_s = PAPER.com_m(falling.angles_rad)[1], 0.0
    for tick in range(200):
        falling.step([-40.0, 20.0 if tick % 100 < 50 else -20.0, -10.0])
        before_m_s = rise_m_s
        rise_m_s += 1e-3 * (falling.foot_force_n / 50.0 - 9.81)
        height_m += 1e-3 * 0.5 * (before_m_s + rise_m_s)
    assert not falling.fallen
    assert abs(PAPER.com_m(falling.angles_rad)[1] - height_m) < 3e-6


def test_fallen_is_half_the_upright_height() -> None:
    """S21. One link leans by 60 degrees when its centre of mass is at half its height."""
    pendulum = Chain([TRUNK])
    assert not body([radians(59.999)], chain=pendulum).fallen
    assert body([radians(60.001)], chain=pendulum).fallen
    assert body([radians(-60.001)], chain=pendulum).fallen
    assert not body([0.0, 0.0, 0.0]).fallen
    # A squat: knees forward, trunk upright. The trunk has 3/5 of the mass.
    assert not body([radians(60.0), radians(-120.0), radians(60.0)]).fallen
    assert body([pi, 0.0, 0.0]).fallen


@pytest.mark.parametrize("number", [nan, inf, -inf])
def test_a_state_that_is_no_number_has_fallen(number: float) -> None:
    """S21: it ends the run instead of raising in it."""
    for joint in range(3):
        angles, rates = body(STILL.copy()), body(STILL.copy())
        angles.angles_rad[joint] = number
        rates.rates_rad_s[joint] = number
        for broken in (angles, rates):
            broken.step([0.0] * 3)
            assert broken.fallen


@pytest.mark.parametrize(
    ("links", "torques"),
    [
        # Far too light for its torque: the state overflows between two evaluations of a step.
        (
            (Link(7.0, 0.01, 0.005, 7e-5), Link(5e-5, 0.07, 0.035, 2e-8)),
            [-2.0, -185.0],
        ),
        # A point mass on a link without mass: nothing resists the lower joint.
        ((Link(1e-30, 0.5, 0.25, 1e-30), Link(30.0, 0.5, 0.25, 1e-30)), [1.0, 1.0]),
    ],
    ids=["overflow", "singular"],
)
def test_a_step_that_cannot_be_computed_is_a_fall(
    links: tuple[Link, ...], torques: list[float]
) -> None:
    """S21: whatever body the scenario describes, it ends the run instead of raising in it."""
    flung = body([0.1, 0.0], chain=Chain(links), tick_s=1e-2, substeps=10)
    for _ in range(20):
        flung.step(torques)
        if flung.fallen:
            break
    assert flung.fallen
