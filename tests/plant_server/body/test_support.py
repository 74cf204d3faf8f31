"""A support that tilts and accelerates: what MuJoCo says of a body on one."""

from collections.abc import Sequence
from itertools import accumulate

import mujoco
import numpy as np
import pytest

from plant_server.body.articulated import LongChain
from plant_server.body.body import Body
from plant_server.body.chain import Chain
from plant_server.body.support import LEVEL, Support
from tests.plant_server.body.oracle import Floats, Oracle, random_links, random_states

TOLERANCE = 1e-9
"""Of the largest torque: rounding, times the condition number of the mass matrix."""
MOVING = Support(tilt_rad=0.1, tilt_rad_s=0.8, tilt_rad_s2=-3.0, forward_m_s2=1.7)
STEADY_TILT = Support(tilt_rad=0.05, tilt_rad_s=0.6)


class MovingOracle:
    """The links in MuJoCo on a slide and a hinge, which move as the support does."""

    def __init__(self, chain: Chain) -> None:
        inner = Oracle(chain.links).xml
        self.model = mujoco.MjModel.from_xml_string(
            inner.replace(
                "<worldbody>",
                '<worldbody><body><joint type="slide" axis="1 0 0"/>'
                '<joint type="hinge" axis="0 1 0"/>'
                '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
            ).replace("</worldbody>", "</body></worldbody>")
        )
        self.data = mujoco.MjData(self.model)

    def torques_nm(
        self,
        support: Support,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        accelerations_rad_s2: Sequence[float],
    ) -> Floats:
        """At the joints, for a motion of joints and support."""
        data = self.data
        data.qpos[:] = 0.3, support.tilt_rad, *angles_rad
        data.qvel[:] = 0.9, support.tilt_rad_s, *rates_rad_s
        data.qacc[:] = support.forward_m_s2, support.tilt_rad_s2, *accelerations_rad_s2
        mujoco.mj_inverse(self.model, data)
        torques: Floats = data.qfrc_inverse[2:].copy()
        return torques


def standing(chain: Chain, angles: Sequence[float], rates: Sequence[float], on: Support) -> Body:
    return Body(
        chain,
        initial_angles_rad=angles,
        initial_rates_rad_s=rates,
        tick_s=1e-6,
        substeps=1,
        fallen_below=-2.0,
        support=on,
    )


def accelerations(body: Body, torques_nm: Sequence[float]) -> list[float]:
    """Over one very short tick."""
    before = body.rates_rad_s
    body.step(torques_nm)
    return [(v - u) / body.tick_s for u, v in zip(before, body.rates_rad_s, strict=True)]


@pytest.mark.parametrize("kind", [Chain, LongChain])
@pytest.mark.parametrize("size", [1, 3, 9])
def test_a_body_on_a_moving_support_moves_as_mujoco_says(kind: type[Chain], size: int) -> None:
    """The joints' accelerations need the torques that act, however the support moves."""
    chain = kind(random_links(size, seed=size))
    oracle = MovingOracle(chain)
    for angles, rates, torques in random_states(size, count=5):
        body = standing(chain, angles, rates, MOVING)
        found = accelerations(body, torques)
        needed = oracle.torques_nm(MOVING, angles, rates, found)
        scale = np.abs(chain.mass_matrix(angles)).max() * max(map(abs, found))
        # In a microsecond the accelerations change by a millionth or so, and 1e-10 is rounded off.
        assert np.abs(needed - torques).max() < 1e-4 * scale


@pytest.mark.parametrize("kind", [Chain, LongChain])
@pytest.mark.parametrize("on", [STEADY_TILT, MOVING])
def test_a_braked_ankle_turns_with_its_support(kind: type[Chain], on: Support) -> None:
    """All joints are held: the brakes bear what MuJoCo says, the ankle's shows on the foot."""
    chain = kind(random_links(4, seed=4))
    still = [0.0] * 4
    angles = [0.1, -0.2, 0.1, 0.05]
    body = standing(chain, angles, still, on)
    for joint in range(4):
        body.brake(joint)
    body.step(still)
    assert body.angles_rad == angles
    needed = MovingOracle(chain).torques_nm(on, angles, still, still)
    assert -body.foot_cop_m * body.foot_force_n == pytest.approx(needed[0], rel=1e-4)


@pytest.mark.parametrize("kind", [Chain, LongChain])
def test_what_stands_on_a_braked_link_is_thrown_by_its_turning(kind: type[Chain]) -> None:
    chain = kind(random_links(3, seed=3))
    angles, rates, torques = [0.1, 0.3, -0.2], [0.0, 0.7, -0.4], [0.0, 12.0, -5.0]
    body = standing(chain, angles, rates, STEADY_TILT)
    body.brake(0)
    found = accelerations(body, torques)
    assert found[0] == 0.0
    needed = MovingOracle(chain).torques_nm(STEADY_TILT, angles, rates, found)
    assert needed[1:] == pytest.approx(torques[1:], rel=1e-4)


def test_a_steady_tilt_moves_nobody_whose_ankle_is_limp() -> None:
    """In space the body falls as it would on a level support; the ankle's angle makes it up."""
    chain = Chain(random_links(3, seed=5))
    angles, torques = [0.05, -0.1, 0.1], [0.0, 3.0, -2.0]
    level = Body(chain, initial_angles_rad=angles, tick_s=1e-3, substeps=2, fallen_below=-2.0)
    tilting = Body(
        chain,
        initial_angles_rad=[angles[0] - STEADY_TILT.tilt_rad, *angles[1:]],
        initial_rates_rad_s=[-STEADY_TILT.tilt_rad_s, 0.0, 0.0],
        tick_s=1e-3,
        substeps=2,
        fallen_below=-2.0,
        support=STEADY_TILT,
    )
    for tick in range(1, 301):
        level.step(torques)
        tilting.step(torques)
        assert tilting.support.tilt_rad == pytest.approx(0.05 + 0.6e-3 * tick)
    assert tilting.orientations_rad() == pytest.approx(level.orientations_rad(), abs=1e-9)
    assert tilting.orientation_rates_rad_s() == pytest.approx(
        level.orientation_rates_rad_s(), abs=1e-9
    )
    assert tilting.foot_force_n == pytest.approx(level.foot_force_n, rel=1e-6)


def test_a_level_support_adds_nothing() -> None:
    """Not even a zero: the body reads the joints' own lists."""
    body = Body(
        Chain(random_links(3, seed=1)), initial_angles_rad=[0.1, -0.0, 0.2], tick_s=1e-3, substeps=1
    )
    assert body.support is LEVEL
    assert body.orientations_rad() == list(accumulate(body.angles_rad))
    body.step([1.0, 2.0, 3.0])
    assert body.support is LEVEL
