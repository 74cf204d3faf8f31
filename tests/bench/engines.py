"""The body of three links in other engines, for `tests.bench.plant`."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant_server.body.chain import GRAVITY_M_S2, Chain
from plant_server.session.config import PlantConfig
from tests.bench.plant import TICK_S

Floats = NDArray[np.float64]


class Mujoco:
    """Hinges about y, z up; nothing touches and nothing rubs, so no constraint is solved."""

    def __init__(self, config: PlantConfig, integrator: str) -> None:
        import mujoco  # noqa: PLC0415 - may be missing

        body = ""
        heights = [0.0, *(link.length_m for link in config.links[:-1])]
        for height, link in zip(reversed(heights), reversed(config.links), strict=True):
            inertia = " ".join([repr(link.inertia_kg_m2)] * 3)
            body = (
                f'<body pos="0 0 {height!r}"><joint type="hinge" axis="0 1 0"/>'
                f'<inertial pos="0 0 {link.com_m!r}" mass="{link.mass_kg!r}"'
                f' diaginertia="{inertia}"/>{body}</body>'
            )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{TICK_S}" integrator="{integrator}"'
            f' gravity="0 0 -{GRAVITY_M_S2}"><flag constraint="disable" contact="disable"/>'
            f"</option><worldbody>{body}</worldbody></mujoco>"
        )
        self._model, self._data, self._step = model, mujoco.MjData(model), mujoco.mj_step
        self._data.qpos[:] = config.initial_angles_rad
        self._torques = self._data.qfrc_applied
        self._angles, self._rates = self._data.qpos, self._data.qvel

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Joint angles and rates."""
        return self._angles.tolist(), self._rates.tolist()

    def step(self, torques_nm: Sequence[float]) -> None:
        """One step of MuJoCo."""
        self._torques[:] = torques_nm
        self._step(self._model, self._data)


def mujoco_rk4(config: PlantConfig) -> Mujoco:
    """The same method as ours."""
    return Mujoco(config, "RK4")


def mujoco_euler(config: PlantConfig) -> Mujoco:
    """What MuJoCo does unless told otherwise: semi-implicit Euler."""
    return Mujoco(config, "Euler")


class Arrays:
    """State in numpy arrays, carried on by RK4 with accelerations that a subclass gives."""

    def __init__(self, config: PlantConfig) -> None:
        self._q: Floats = np.array(config.initial_angles_rad)
        self._v: Floats = np.zeros(len(config.links))

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Joint angles and rates."""
        return self._q.tolist(), self._v.tolist()

    def step(self, torques_nm: Sequence[float]) -> None:
        """The classical Runge-Kutta step."""
        q, v, h, tau = self._q, self._v, TICK_S, np.array(torques_nm)
        a1 = self.acceleration(q, v, tau)
        v2 = v + 0.5 * h * a1
        a2 = self.acceleration(q + 0.5 * h * v, v2, tau)
        v3 = v + 0.5 * h * a2
        a3 = self.acceleration(q + 0.5 * h * v2, v3, tau)
        v4 = v + h * a3
        a4 = self.acceleration(q + h * v3, v4, tau)
        self._q = q + h / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        self._v = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)

    def acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Joint accelerations."""
        raise NotImplementedError


class Pinocchio(Arrays):
    """Its articulated-body algorithm."""

    def __init__(self, config: PlantConfig) -> None:
        import pinocchio as pin  # noqa: PLC0415 - may be missing

        super().__init__(config)
        model, height_m, joint = pin.Model(), 0.0, 0
        model.gravity.linear = np.array([0.0, 0.0, -GRAVITY_M_S2])
        for i, link in enumerate(config.links):
            place = pin.SE3(np.eye(3), np.array([0.0, 0.0, height_m]))
            joint = model.addJoint(joint, pin.JointModelRY(), place, f"joint_{i}")
            com = np.array([0.0, 0.0, link.com_m])
            inertia = pin.Inertia(link.mass_kg, com, link.inertia_kg_m2 * np.eye(3))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            height_m = link.length_m
        self._model, self._data, self._aba = model, model.createData(), pin.aba

    def acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Joint accelerations."""
        # A copy: the algorithm answers with an array of its own, and overwrites it the next time.
        return np.array(self._aba(self._model, self._data, q, v, tau))


class Numpy(Arrays):
    """The equations of `plant_server.body.chain` as arrays."""

    def __init__(self, config: PlantConfig) -> None:
        super().__init__(config)
        chain = Chain(config.links)
        lower = np.array(
            [[*row, *[0.0] * (chain.size - len(row))] for row in chain._inertias], dtype=np.float64
        )
        self._inertias = lower + np.tril(lower, -1).T
        self._weights = np.array(chain._weights)
        self._sum = np.tril(np.ones((chain.size, chain.size)))
        self._differ = np.linalg.inv(self._sum)

    def acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Joint accelerations."""
        theta, omega = self._sum @ q, self._sum @ v
        turn = theta[:, None] - theta
        forces = self._differ.T @ tau + self._weights * np.sin(theta)
        forces -= (self._inertias * np.sin(turn)) @ (omega * omega)
        matrix: Floats = self._inertias * np.cos(turn)
        return np.asarray(self._differ @ np.linalg.solve(matrix, forces), dtype=np.float64)


class SolveIvp:
    """Our equations under scipy's adaptive method, with its default tolerances, tick by tick."""

    def __init__(self, config: PlantConfig) -> None:
        self._acceleration: Callable[..., list[float]] = Chain(config.links).accelerations_rad_s2
        self._size = len(config.links)
        self._state: list[float] = [*config.initial_angles_rad, *[0.0] * self._size]

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Joint angles and rates."""
        return self._state[: self._size], self._state[self._size :]

    def step(self, torques_nm: Sequence[float]) -> None:
        """Solve for one tick."""

        def slope(_time_s: float, state: Any) -> list[float]:
            q, v = state[: self._size].tolist(), state[self._size :].tolist()
            return [*v, *self._acceleration(q, v, torques_nm)]

        self._state = solve_ivp(slope, (0.0, TICK_S), self._state).y[:, -1].tolist()
