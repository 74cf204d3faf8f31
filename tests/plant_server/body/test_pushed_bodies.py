"""Bodies that are pushed: work, momentum and symmetry, with and without brakes."""

from math import pi, radians

import numpy as np
import pytest

from tests.plant_server.body.bodies import PAPER, STILL, body, com_x_m, spring_j


@pytest.mark.parametrize("link", range(3))
@pytest.mark.parametrize("braked", [(), (1,), (0,), (0, 2)])
def test_a_push_does_work(link: int, braked: tuple[int, ...]) -> None:
    """The energy gained is force times way of the centre of mass, for a constant force exactly.

    What remains is the step's error: 1e-9 of the work, as for constant torques.
    """
    pushed = body([pi, 0.1, -0.1], braked=braked)
    pushed.forces_n[link] = 25.0
    start_m, before_j = com_x_m(PAPER, link, pushed.angles_rad), spring_j(pushed, [(0.0, 0.0)] * 3)
    works_j = [0.1]
    for _ in range(2000):
        pushed.step(STILL)
        works_j.append(25.0 * (com_x_m(PAPER, link, pushed.angles_rad) - start_m))
    gained_j = spring_j(pushed, [(0.0, 0.0)] * 3) - before_j
    assert abs(gained_j - works_j[-1]) < 1e-9 * max(map(abs, works_j))


def test_a_push_is_a_momentum() -> None:
    """From rest upright, F h turns into momenta of F h times the height of its centre of mass.

    In one tick the body leans by 1e-5, so gravity adds 1e-5 of it, and lean less: 1e-4.
    """
    pushed = body(STILL)
    pushed.forces_n = [0.0, 0.0, 100.0]
    pushed.step(STILL)
    momenta = np.asarray(PAPER.mass_matrix(STILL)) @ pushed.rates_rad_s
    assert momenta.tolist() == pytest.approx([0.1 * 1.25, 0.1 * 0.75, 0.1 * 0.25], rel=1e-4)


def test_no_push_is_no_change() -> None:
    """After a push has ended, a body is one that starts there, to the bit."""
    pushed = body([0.1, 0.0, -0.1])
    pushed.forces_n = [0.0, 0.0, 50.0]
    pushed.step(STILL)
    pushed.forces_n = [0.0, 0.0, 0.0]
    fresh = body(pushed.angles_rad, rates_rad_s=pushed.rates_rad_s)
    for _ in range(20):
        pushed.step([1.0, 2.0, 3.0])
        fresh.step([1.0, 2.0, 3.0])
    assert (pushed.angles_rad, pushed.rates_rad_s) == (fresh.angles_rad, fresh.rates_rad_s)


def test_a_mirrored_push_on_a_mirrored_body_is_the_mirror_image() -> None:
    """Brake and spring included, to the bit."""
    there, back = body([0.1, -0.2, 0.3]), body([-0.1, 0.2, -0.3])
    for sign, each in ((1.0, there), (-1.0, back)):
        each.forces_n = [0.0, sign * 40.0, sign * -5.0]
        each.make_passive(0, 300.0, 10.0)
    for tick in range(200):
        if tick == 100:
            assert there.brake(1) == back.brake(1) > 0.0
        there.step([1.0, 2.0, 3.0])
        back.step([-1.0, -2.0, -3.0])
    assert back.angles_rad == [-angle for angle in there.angles_rad]
    assert back.rates_rad_s == [-rate for rate in there.rates_rad_s]
    assert back.foot_force_n == there.foot_force_n
    assert back.foot_cop_m == -there.foot_cop_m


# What stays as it was.


def test_a_push_can_make_it_fall() -> None:
    """S21: also with every joint but the ankle braked, when it is one rigid pendulum."""
    pushed = body(STILL, braked=[1, 2])
    pushed.forces_n = [0.0, 0.0, 200.0]
    for _ in range(2000):
        pushed.step(STILL)
        if pushed.fallen:
            break
    assert pushed.fallen
    assert pushed.angles_rad[0] == pytest.approx(radians(60.0), abs=0.02)
