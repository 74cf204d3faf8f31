"""Lumping a chain link by link gives what summing all its masses at once gives."""

from math import cos, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from module_agent.firmware.kinematics import (
    NOTHING,
    CarriedMass,
    add_link,
    carried_rigidly,
    shape_of,
)
from protocol.robot.hardware import Link

pytestmark = pytest.mark.sampling

LAW = settings(max_examples=200, deadline=None, derandomize=True)
DIFFERENCE_S = 1e-5
"""Central differences: truncation below 1e-7 for rates up to 3 rad/s, rounding below 1e-10."""


@st.composite
def links(draw: st.DrawFn) -> Link:
    length = draw(st.floats(0.1, 1.0))
    return Link(draw(st.floats(0.5, 60.0)), length, draw(st.floats(0.05, 1.0)) * length, 0.1)


ANGLES = st.floats(-pi, pi)
RATES = st.floats(-3.0, 3.0)
Limb = tuple[Link, float, float]
LIMBS = st.lists(st.tuples(links(), ANGLES, RATES), min_size=1, max_size=5)
"""A chain from the ground up: link, orientation in space, rate."""


def lumped(limbs: list[Limb]) -> CarriedMass:
    """As boards do it, from the top down."""
    above = NOTHING
    for link, angle_rad, rate_rad_s in reversed(limbs):
        above = add_link(link, angle_rad, rate_rad_s, above)
    return above


def summed(limbs: list[Limb], time_s: float = 0.0) -> tuple[float, float, float]:
    """Mass and centre of mass by brute force, each link turned on by its rate for `time_s`."""
    base_x = base_y = mass = moment_x = moment_y = 0.0
    for link, angle_rad, rate_rad_s in limbs:
        angle = angle_rad + rate_rad_s * time_s
        mass += link.mass_kg
        moment_x += link.mass_kg * (base_x + link.com_m * sin(angle))
        moment_y += link.mass_kg * (base_y + link.com_m * cos(angle))
        base_x += link.length_m * sin(angle)
        base_y += link.length_m * cos(angle)
    return mass, moment_x / mass, moment_y / mass


@LAW
@given(LIMBS)
def test_lumping_is_summing(limbs: list[Limb]) -> None:
    whole = lumped(limbs)
    assert (whole.mass_kg, whole.x_m, whole.y_m) == pytest.approx(summed(limbs), abs=1e-12)


@LAW
@given(LIMBS)
def test_velocity_is_the_derivative_of_position(limbs: list[Limb]) -> None:
    whole = lumped(limbs)
    _, x_before, y_before = summed(limbs, -DIFFERENCE_S)
    _, x_after, y_after = summed(limbs, DIFFERENCE_S)
    assert whole.x_m_s == pytest.approx((x_after - x_before) / (2 * DIFFERENCE_S), abs=1e-6)
    assert whole.y_m_s == pytest.approx((y_after - y_before) / (2 * DIFFERENCE_S), abs=1e-6)


@LAW
@given(
    st.lists(st.tuples(links(), st.floats(-0.7, 0.7), RATES), min_size=1, max_size=5),
)
def test_sway_rate_is_the_derivative_of_sway(limbs: list[Limb]) -> None:
    """Leaning at most 40 degrees, so that the angle has no jump."""

    def sway(time_s: float) -> float:
        mass, x_m, y_m = summed(limbs, time_s)
        return CarriedMass(mass, x_m, y_m, 0.0, 0.0).sway_rad()

    numeric = (sway(DIFFERENCE_S) - sway(-DIFFERENCE_S)) / (2 * DIFFERENCE_S)
    assert lumped(limbs).sway_rad() == pytest.approx(sway(0.0), abs=1e-12)
    assert lumped(limbs).sway_rad_s() == pytest.approx(numeric, abs=1e-5)


@LAW
@given(links(), ANGLES, RATES, LIMBS, ANGLES, RATES)
def test_rigid_carry_is_exact_for_a_rigid_body(
    carrier: Link, angle: float, rate: float, above: list[Limb], turned: float, new_rate: float
) -> None:
    """S9: what is bolted to a link is where it would be after the link has turned."""
    heard = lumped([(link, at, rate) for link, at, _ in above])
    carried = carried_rigidly(shape_of(heard, angle), angle + turned, new_rate)
    real = lumped([(link, at + turned, new_rate) for link, at, _ in above])
    assert carried == pytest.approx(real, abs=1e-9)
    whole = add_link(carrier, angle + turned, new_rate, carried)
    assert whole == pytest.approx(add_link(carrier, angle + turned, new_rate, real), abs=1e-9)


@LAW
@given(ANGLES, st.floats(0.1, 50.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_shape_that_has_not_turned_is_where_it_was(
    angle: float, mass: float, x_m: float, y_m: float
) -> None:
    above = CarriedMass(mass, x_m, y_m, 0.0, 0.0)
    assert carried_rigidly(shape_of(above, angle), angle, 0.0) == pytest.approx(above, abs=1e-12)


@LAW
@given(LIMBS, st.floats(0.1, 10.0))
def test_only_ratios_of_masses_matter(limbs: list[Limb], factor: float) -> None:
    scaled = [(replace(link, mass_kg=factor * link.mass_kg), a, r) for link, a, r in limbs]
    assert lumped(scaled)[1:] == pytest.approx(lumped(limbs)[1:], abs=1e-11)
    assert lumped(scaled).mass_kg == pytest.approx(factor * lumped(limbs).mass_kg)


@LAW
@given(LIMBS)
def test_forwards_and_backwards_are_alike(limbs: list[Limb]) -> None:
    whole, mirrored = lumped(limbs), lumped([(link, -a, -r) for link, a, r in limbs])
    mass, x_m, y_m, x_m_s, y_m_s = whole
    assert mirrored == pytest.approx((mass, -x_m, y_m, -x_m_s, y_m_s), abs=1e-12)


@LAW
@given(LIMBS, ANGLES)
def test_turning_everything_turns_the_centre_of_mass(limbs: list[Limb], turn: float) -> None:
    whole, turned = lumped(limbs), lumped([(link, a + turn, r) for link, a, r in limbs])
    sine, cosine = sin(turn), cos(turn)
    assert turned.x_m == pytest.approx(whole.x_m * cosine + whole.y_m * sine, abs=1e-11)
    assert turned.y_m == pytest.approx(whole.y_m * cosine - whole.x_m * sine, abs=1e-11)


@LAW
@given(links(), ANGLES, RATES)
def test_a_link_that_carries_nothing_is_itself(link: Link, angle: float, rate: float) -> None:
    """Its inertia is of no concern to its centre of mass."""
    whole = add_link(link, angle, rate, NOTHING)
    expected = (link.com_m * sin(angle), link.com_m * cos(angle))
    assert (whole.mass_kg, whole.x_m, whole.y_m) == pytest.approx((link.mass_kg, *expected))


def test_upright_is_zero_and_forward_is_positive() -> None:
    link = Link(10.0, 0.5, 0.25, 0.2)
    assert add_link(link, 0.0, 0.0, NOTHING).sway_rad() == 0.0
    assert add_link(link, 0.1, 0.0, NOTHING).sway_rad() == pytest.approx(0.1)
    assert add_link(link, 0.1, 0.3, NOTHING).sway_rad_s() == pytest.approx(0.3)
