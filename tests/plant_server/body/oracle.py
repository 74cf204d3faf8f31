"""What tests of the dynamics share: chains and states at random, and MuJoCo to ask about them."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from protocol.robot.hardware import Link

Floats = NDArray[np.float64]
State = tuple[list[float], list[float], list[float]]


def random_links(size: int, *, seed: int) -> tuple[Link, ...]:
    """Links from finger to torso, their mass anywhere along them."""
    rng = np.random.default_rng(seed)
    links = []
    for _ in range(size):
        mass_kg, length_m = float(rng.uniform(0.5, 40.0)), float(rng.uniform(0.1, 0.8))
        com_m = length_m * float(rng.uniform(0.1, 1.0))
        inertia_kg_m2 = mass_kg * length_m**2 * float(rng.uniform(0.02, 0.2))
        links.append(Link(mass_kg, length_m, com_m, inertia_kg_m2))
    return tuple(links)


def random_states(size: int, *, count: int) -> list[State]:
    """Angles, rates and torques, over the whole circle and faster than a body moves."""
    rng = np.random.default_rng(100 + size)
    return [
        (
            rng.uniform(-np.pi, np.pi, size).tolist(),
            rng.uniform(-5.0, 5.0, size).tolist(),
            rng.uniform(-200.0, 200.0, size).tolist(),
        )
        for _ in range(count)
    ]


class Reference(NamedTuple):
    """What MuJoCo says of one state."""

    mass_matrix: Floats
    bias_nm: Floats
    accelerations_rad_s2: Floats
    com_m: Floats
    com_rise_m_s: float


class Oracle:
    """The same links in MuJoCo: hinges about y, z up, so forward is x and positive as here."""

    def __init__(self, links: Sequence[Link]) -> None:
        body = ""
        heights = [0.0, *(link.length_m for link in links[:-1])]
        for height, link in zip(reversed(heights), reversed(links), strict=True):
            # Only the inertia about y matters in the plane; a sphere's satisfies MuJoCo.
            inertia = " ".join([repr(link.inertia_kg_m2)] * 3)
            body = (
                f'<body pos="0 0 {height!r}"><joint type="hinge" axis="0 1 0"/>'
                f'<inertial pos="0 0 {link.com_m!r}" mass="{link.mass_kg!r}"'
                f' diaginertia="{inertia}"/>{body}</body>'
            )
        self.xml = f'<mujoco><option gravity="0 0 -9.81"/><worldbody>{body}</worldbody></mujoco>'
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.data = mujoco.MjData(self.model)

    def at(self, state: State) -> Reference:
        model, data = self.model, self.data
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = state
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        matrix = np.zeros((model.nv, model.nv))
        for row, unit in zip(matrix, np.eye(model.nv), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        return Reference(
            matrix,
            data.qfrc_bias.copy(),
            data.qacc.copy(),
            data.subtree_com[1, [0, 2]].copy(),
            float(data.subtree_linvel[1, 2]),
        )


def relative_error(ours: object, theirs: Floats) -> float:
    """Largest difference over the largest entry."""
    return float(np.abs(np.asarray(ours) - theirs).max() / np.abs(theirs).max())
