"""The body in motion: a chain, its state, and the fixed step that carries it over a tick.

A joint is driven (or limp: driven by 0 N m), braked, or passive, and stays so until told otherwise.
Braked, it is no joint: its angle is constant to the bit (S17, `clusters`). Passive, a
spring and a damper act in it instead of its board. Besides, links may be pushed horizontally, and
each joint may have a spring and a damper of its own, beside whatever drives it (the paper's table I
has them as 0). The ankle stands on a `Support`; level and at rest, unless it is given another.
"""

from collections.abc import Sequence
from itertools import accumulate
from math import isfinite, nan
from typing import NamedTuple

from plant_server.body.chain import Chain
from plant_server.body.support import LEVEL, Support


class Spring(NamedTuple):
    """What acts in a passive joint: -k (q - q0) - d q'."""

    rest_rad: float
    stiffness_nm_rad: float
    damping_nm_s_rad: float

    def torque_nm(self, angle_rad: float, rate_rad_s: float) -> float:
        """The torque of spring and damper."""
        stretch_rad = angle_rad - self.rest_rad
        return -self.stiffness_nm_rad * stretch_rad - self.damping_nm_s_rad * rate_rad_s


class Body:
    """A chain with joint angles and rates.

    A tick is `substeps` steps of the classical fourth-order Runge-Kutta method; the torques are
    held in between. While `locked`, the body stays in its posture whatever acts on it.
    It has fallen when its centre of mass is below `fallen_below` of its upright height.
    """

    forces_n: list[float]
    """Horizontal force on each link at its centre of mass, forward positive, in every tick until
    changed. 0.0: none."""
    torques_nm: list[float]
    """What the torque sensors show: the torque of the motor or of the passive element at the start
    of the last tick. A brake and the joint's own spring hold beside the sensor, so a braked joint
    shows 0.0."""
    foot_force_n: float
    """Mean vertical force under the foot over the last tick, with the impact of a brake in it."""

    def __init__(
        self,
        chain: Chain,
        *,
        initial_angles_rad: Sequence[float],
        tick_s: float,
        substeps: int,
        fallen_below: float = 0.5,
        initial_rates_rad_s: Sequence[float] | None = None,
        passive: Sequence[Spring | None] = (),
        support: Support = LEVEL,
    ) -> None:
        self.chain = chain
        self.support = support
        self.tick_s = tick_s
        self.substeps = substeps
        self.locked = False
        self.angles_rad = list(initial_angles_rad)
        self.rates_rad_s = list(initial_rates_rad_s or [0.0] * chain.size)
        self.torques_nm = [0.0] * chain.size
        self.forces_n = [0.0] * chain.size
        self.foot_force_n = chain.mass_kg * chain.gravity_m_s2
        self._braked = [False] * chain.size
        self._springs: dict[int, Spring] = {}
        self._own = {joint: spring for joint, spring in enumerate(passive) if spring is not None}
        """Springs and dampers of the joints themselves."""
        self._plain = True
        self._ankle_nm = 0.0
        self._ankle_impulse_nms = 0.0
        self._rise_m_s = self._com_rise_m_s()
        upright_m = chain.com_m([0.0] * chain.size)[1]
        self._fallen_below_m = fallen_below * upright_m
        self.fallen = self._is_fallen()
        """The centre of mass is too low, or the state is not finite (S21)."""

    def release(self, joint: int) -> None:
        """Let the torque given to `step` drive the joint (0 N m: limp). Rates stay."""
        assert 0 <= joint < self.chain.size
        self._braked[joint] = False
        self._springs.pop(joint, None)

    def make_passive(self, joint: int, stiffness_nm_rad: float, damping_nm_s_rad: float) -> None:
        """Put a spring, at rest at the present angle, and a damper in the board's place."""
        self.release(joint)
        self._springs[joint] = Spring(self.angles_rad[joint], stiffness_nm_rad, damping_nm_s_rad)

    def brake(self, joint: int) -> float:
        """Stop the joint at once and hold it; return the kinetic energy lost in the impact, J.

        By Carnot's theorem that is the kinetic energy of the change of rates, which cannot come
        out negative. Of a body that has flown apart it is 0.0.
        """
        self.release(joint)
        self._braked[joint] = True
        if self.rates_rad_s[joint] == 0.0:
            self.rates_rad_s[joint] = 0.0  # It may have been -0.0.
            return 0.0
        chain, angles, before = self.chain, self._angles_in_space_rad(), self.rates_rad_s
        try:
            after = chain.braked_rates_rad_s(angles, before, self._braked)
            changes = [v - u for v, u in zip(after, before, strict=True)]
            impulses = chain.impulses_nms(angles, changes)
        except (ValueError, ArithmeticError):
            self._fly_apart()
            return 0.0
        self.rates_rad_s = after
        if self._braked[0]:
            self._ankle_impulse_nms += impulses[0]
        lost_j = 0.0
        for impulse, change in zip(impulses, changes, strict=True):
            lost_j += 0.5 * impulse * change
        return max(0.0, lost_j) if isfinite(lost_j) else 0.0

    def step(self, torques_nm: Sequence[float]) -> None:
        """Integrate one tick with constant joint torques, shape (n,)."""
        if self.locked:
            return
        chain, moves = self.chain, self.support is not LEVEL
        impact = self._ankle_impulse_nms != 0.0
        held = self._springs or self._own or True in self._braked or impact or moves
        self._plain = not (held or any(self.forces_n))
        step_s = self.tick_s / self.substeps
        try:
            self.torques_nm = list(torques_nm) if self._plain else self._sensed_nm(torques_nm)
            self._ankle_nm = self.torques_nm[0] if self._plain else self._through_ankle_nm()
            for _ in range(self.substeps):
                self._runge_kutta(step_s)
        except (ValueError, ArithmeticError):  # It flew apart within the step.
            self._fly_apart()
        self.fallen = self._is_fallen()
        if self.fallen:
            return
        rise_m_s = self._com_rise_m_s()
        gained_m_s, self._rise_m_s = rise_m_s - self._rise_m_s, rise_m_s
        self.foot_force_n = chain.mass_kg * (chain.gravity_m_s2 + gained_m_s / self.tick_s)

    def passive_nm(self, joint: int) -> float:
        """What the joint's own spring and damper do at this moment."""
        spring = self._own.get(joint)
        return 0.0 if spring is None else self._stretched_nm(joint, spring)

    @property
    def foot_cop_m(self) -> float:
        """Centre of pressure that a massless foot under the ankle shows, forward of the ankle.

        From the torque through the ankle, also when a brake bears it; the ground holds against
        pushes at the height of the ankle, so without a moment.
        """
        return -self._ankle_nm / self.foot_force_n if self.foot_force_n > 0.0 else 0.0

    def orientations_rad(self) -> list[float]:
        """Of each link in space, from the vertical."""
        return list(accumulate(self._angles_in_space_rad()))

    def orientation_rates_rad_s(self) -> list[float]:
        """Of each link in space."""
        return list(accumulate(self._rates_in_space_rad_s()))

    def _angles_in_space_rad(self) -> list[float]:
        """Joint angles, the ankle's from the vertical."""
        support, angles = self.support, self.angles_rad
        return angles if support is LEVEL else support.angles_rad(angles)

    def _rates_in_space_rad_s(self) -> list[float]:
        support, rates = self.support, self.rates_rad_s
        return rates if support is LEVEL else support.rates_rad_s(rates)

    def _com_rise_m_s(self) -> float:
        """Vertical velocity of the centre of mass."""
        return self.chain.com_rise_m_s(self._angles_in_space_rad(), self._rates_in_space_rad_s())

    def _is_fallen(self) -> bool:
        if not all(map(isfinite, self.angles_rad)) or not all(map(isfinite, self.rates_rad_s)):
            return True
        return self.chain.com_m(self._angles_in_space_rad())[1] < self._fallen_below_m

    def _fly_apart(self) -> None:
        self.angles_rad = self.rates_rad_s = [nan] * self.chain.size
        self.fallen = True

    def _sensed_nm(self, torques_nm: Sequence[float]) -> list[float]:
        """What acts in the joints, but for brakes, at the start of a tick."""
        sensed = [
            0.0 if braked else torque
            for braked, torque in zip(self._braked, torques_nm, strict=True)
        ]
        for joint, spring in self._springs.items():
            sensed[joint] = self._stretched_nm(joint, spring)
        return sensed

    def _stretched_nm(self, joint: int, spring: Spring) -> float:
        return spring.torque_nm(self.angles_rad[joint], self.rates_rad_s[joint])

    def _through_ankle_nm(self) -> float:
        """Torque from foot to shank at the start of a tick, and the last impact in its mean."""
        torque_nm = self.torques_nm[0] + self.passive_nm(0)
        if self._braked[0]:
            torque_nm = self._brake_nm()
        impulse_nms, self._ankle_impulse_nms = self._ankle_impulse_nms, 0.0
        return torque_nm + impulse_nms / self.tick_s

    def _brake_nm(self) -> float:
        """What the brake of the ankle bears."""
        chain, support = self.chain, self.support
        q, v = self._angles_in_space_rad(), self._rates_in_space_rad_s()
        accelerations = self._accelerations_rad_s2(
            self.angles_rad, self.rates_rad_s, self.torques_nm, support
        )
        borne_nm = chain.inverse_nm(q, v, accelerations)[0]
        borne_nm -= chain.push_torques_nm(q, self.forces_n)[0]
        return borne_nm if support is LEVEL else borne_nm - support.torques_nm(chain, q)[0]

    def _accelerations_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
        support: Support,
    ) -> list[float]:
        """Joint accelerations with whatever acts on the body, at any stage of a step."""
        chain = self.chain
        if self._plain:
            return chain.accelerations_rad_s2(angles_rad, rates_rad_s, torques_nm)
        q, v = angles_rad, rates_rad_s
        if support is not LEVEL:
            q, v = support.angles_rad(angles_rad), support.rates_rad_s(rates_rad_s)
        outside_nm = chain.push_torques_nm(q, self.forces_n)
        if support is not LEVEL:
            inertial_nm = support.torques_nm(chain, q)
            outside_nm = [a + b for a, b in zip(outside_nm, inertial_nm, strict=True)]
        torques = [torque + outside for torque, outside in zip(torques_nm, outside_nm, strict=True)]
        for joint, spring in self._springs.items():
            torque_nm = spring.torque_nm(angles_rad[joint], rates_rad_s[joint])
            torques[joint] = torque_nm + outside_nm[joint]
        for joint, spring in self._own.items():
            torques[joint] += spring.torque_nm(angles_rad[joint], rates_rad_s[joint])
        if any(self._braked):
            return chain.braked_accelerations_rad_s2(q, v, torques, self._braked)
        return chain.accelerations_rad_s2(q, v, torques)

    def _runge_kutta(self, step_s: float) -> None:
        q, v = self.angles_rad, self.rates_rad_s
        tau, half = self.torques_nm, 0.5 * step_s
        written_out = self.chain.written_out_step
        if self._plain and written_out is not None:
            self.angles_rad, self.rates_rad_s = written_out(*q, *v, *tau, step_s)
            return
        now = midway = then = self.support
        if now is not LEVEL:
            midway, then = now.ahead(half), now.ahead(step_s)
        acceleration = self._accelerations_rad_s2
        a1 = acceleration(q, v, tau, now)
        v2 = [x + half * a for x, a in zip(v, a1, strict=True)]
        a2 = acceleration([x + half * r for x, r in zip(q, v, strict=True)], v2, tau, midway)
        v3 = [x + half * a for x, a in zip(v, a2, strict=True)]
        a3 = acceleration([x + half * r for x, r in zip(q, v2, strict=True)], v3, tau, midway)
        v4 = [x + step_s * a for x, a in zip(v, a3, strict=True)]
        a4 = acceleration([x + step_s * r for x, r in zip(q, v3, strict=True)], v4, tau, then)
        self.support = then
        sixth = step_s / 6.0
        self.angles_rad = [
            x + sixth * (r1 + 2.0 * (r2 + r3) + r4)
            for x, r1, r2, r3, r4 in zip(q, v, v2, v3, v4, strict=True)
        ]
        self.rates_rad_s = [
            x + sixth * (r1 + 2.0 * (r2 + r3) + r4)
            for x, r1, r2, r3, r4 in zip(v, a1, a2, a3, a4, strict=True)
        ]
