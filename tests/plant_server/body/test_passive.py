"""Springs and dampers of the joints themselves, beside the motors."""

from itertools import pairwise
from math import pi, sqrt

import pytest

from plant_server.body.body import Body, Spring
from plant_server.body.chain import Chain
from protocol.robot.hardware import Link

POLE = Link(10.0, 1.0, 0.5, 10.0 / 12.0)
TRUNK = Link(20.0, 0.5, 0.25, 20.0 * 0.25 / 12.0)
MGH = 10.0 * 9.81 * 0.5


def standing(
    springs: list[Spring | None], angles_rad: list[float], links: tuple[Link, ...] = (POLE,)
) -> Body:
    return Body(
        Chain(links), initial_angles_rad=angles_rad, tick_s=1e-3, substeps=1, passive=springs
    )


def test_a_stiff_enough_ankle_stands_by_itself_and_swings_as_a_pendulum_does() -> None:
    """k - m g h drives it back; for a small lean that is a harmonic motion."""
    stiffness = 3.0 * MGH
    body = standing([Spring(0.0, stiffness, 0.0)], [0.01])
    inertia = POLE.inertia_kg_m2 + POLE.mass_kg * POLE.com_m**2
    period_s = 2.0 * pi / sqrt((stiffness - MGH) / inertia)
    leans = []
    for _ in range(round(period_s / 1e-3)):
        leans.append(body.angles_rad[0])
        body.step([0.0])
    assert body.angles_rad[0] == pytest.approx(0.01, rel=1e-4)
    assert min(leans) == pytest.approx(-0.01, rel=1e-3)


def test_without_damping_energy_stays_and_with_it_only_falls() -> None:
    def energies(damping: float) -> list[float]:
        springs = [Spring(0.1, 400.0, damping), Spring(-0.2, 100.0, damping)]
        body = standing(list(springs), [0.2, -0.3], (POLE, TRUNK))
        found = []
        for _ in range(2000):
            stored = sum(
                0.5 * spring.stiffness_nm_rad * (angle - spring.rest_rad) ** 2
                for spring, angle in zip(springs, body.angles_rad, strict=True)
            )
            found.append(stored + body.chain.energy_j(body.angles_rad, body.rates_rad_s))
            body.step([0.0, 0.0])
        return found

    free = energies(0.0)
    assert max(free) - min(free) < 1e-6 * abs(free[0])
    damped = energies(5.0)
    assert all(after <= before + 1e-9 for before, after in pairwise(damped))
    assert damped[-1] < damped[0] - 0.2


def test_at_rest_in_its_rest_posture_it_does_nothing() -> None:
    body = standing([Spring(0.0, 100.0, 10.0)], [0.0])
    for _ in range(100):
        body.step([0.0])
    assert (body.angles_rad, body.rates_rad_s) == ([0.0], [0.0])


def test_the_motors_sensor_does_not_feel_it_and_the_foot_does() -> None:
    body = standing([Spring(0.0, 200.0, 0.0)], [0.05])
    body.step([3.0])
    assert body.torques_nm == [3.0]
    assert body.passive_nm(0) == -200.0 * body.angles_rad[0]
    assert body.foot_cop_m == pytest.approx(-(3.0 - 200.0 * 0.05) / body.foot_force_n)


def test_a_brake_holds_against_it_and_a_release_sets_it_free() -> None:
    body = standing([Spring(0.0, 5.0 * MGH, 0.0)], [0.05])
    body.brake(0)
    for _ in range(50):
        body.step([0.0])
    assert body.angles_rad == [0.05]
    body.release(0)
    body.step([0.0])
    assert body.angles_rad[0] < 0.05


def test_it_acts_beside_what_stands_in_for_a_board() -> None:
    """Two springs in one joint are as stiff as both."""
    both = standing([Spring(0.0, 100.0, 2.0)], [0.05])
    both.make_passive(0, 80.0, 4.0)
    one = standing([None], [0.05])
    one.make_passive(0, 80.0, 4.0)
    both.step([0.0])
    one.step([0.0])
    assert both.angles_rad[0] < one.angles_rad[0]
