"""Dynamics of a planar chain of rigid links on a joint fixed to the ground.

    M(q) q'' + b(q, q') = tau

Any number of links. Coordinates are joint angles q, from the ground up; the work is done in the
links' orientations in space theta_i = q_0 + ... + q_i, from the vertical, forward positive, where
mass matrix and bias are short (Goldstein; the same equations as in Alexandrov et al. 2005):

    A_ij cos(theta_i - theta_j) theta''_j + A_ij sin(theta_i - theta_j) theta'_j^2
        - B_i g sin(theta_i) = tau_i - tau_(i+1)

with B_i = m_i c_i + l_i (mass above link i), A_ii = I_i + m_i c_i^2 + l_i^2 (mass above link i)
and A_ij = l_j B_i for j < i. Scalar Python: for three links it is twice as fast as numpy, and does
the same floating-point operations on every run. The work grows with the cube of the links:
`plant_server.body.articulated` has the same equations for long chains.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import accumulate
from math import cos, sin

from plant_server.body.clusters import clusters, differences, product, solve, solve_held
from plant_server.body.unrolled import LINKS_MAX, accelerations, runge_kutta
from protocol.robot.hardware import Link

GRAVITY_M_S2 = 9.81


class Chain:
    """Equations of motion of a chain; holds parameters, no state."""

    def __init__(self, links: Sequence[Link], gravity_m_s2: float = GRAVITY_M_S2) -> None:
        self.links = tuple(links)
        self.size = len(self.links)
        self.gravity_m_s2 = gravity_m_s2
        self.mass_kg = 0.0
        above = []
        for link in reversed(self.links):
            above.append(self.mass_kg)
            self.mass_kg += link.mass_kg
        above.reverse()
        moments = [
            link.mass_kg * link.com_m + link.length_m * mass
            for link, mass in zip(self.links, above, strict=True)
        ]
        self._weights = [gravity_m_s2 * moment for moment in moments]
        self._moments = moments
        self._above_kg = above
        self._written_out = (
            accelerations(self._inertias, self._weights) if self.size <= LINKS_MAX else None
        )
        self.written_out_step = (
            None if self._written_out is None else runge_kutta(self._written_out, self.size)
        )
        """A Runge-Kutta step of the free chain; None: it has too many links to write it out."""

    @cached_property
    def _inertias(self) -> list[list[float]]:
        """Lower triangle of A_ij: as many numbers as a long chain would not want to hold."""
        return [
            [self.links[j].length_m * self._moments[i] for j in range(i)]
            + [link.inertia_kg_m2 + link.mass_kg * link.com_m**2 + link.length_m**2 * above_kg]
            for i, (link, above_kg) in enumerate(zip(self.links, self._above_kg, strict=True))
        ]

    def mass_matrix(self, angles_rad: Sequence[float]) -> list[list[float]]:
        """M(q), shape (n, n), in joint coordinates, kg m^2."""
        thetas = list(accumulate(angles_rad))
        n = self.size
        full = [
            [self._inertias[max(i, j)][min(i, j)] * cos(thetas[i] - thetas[j]) for j in range(n)]
            for i in range(n)
        ]
        # theta_i counts every joint below it, so each joint gathers all links above it.
        return [
            [sum(full[a][b] for a in range(i, n) for b in range(j, n)) for j in range(n)]
            for i in range(n)
        ]

    def bias_nm(self, angles_rad: Sequence[float], rates_rad_s: Sequence[float]) -> list[float]:
        """b(q, q'), shape (n,): the torques that give no acceleration, gravity included, N m."""
        _, forces = self._equations(angles_rad, rates_rad_s, [0.0] * self.size)
        # The links' equations carry tau_i - tau_(i+1); summing from the top gives tau_i.
        return [-force for force in accumulate(reversed(forces))][::-1]

    def accelerations_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
    ) -> list[float]:
        """Joint accelerations q'' for joint torques tau, shape (n,)."""
        if self._written_out is not None:
            return list(self._written_out(*angles_rad, *rates_rad_s, *torques_nm))
        return self.accelerations_in_loops_rad_s2(angles_rad, rates_rad_s, torques_nm)

    def accelerations_in_loops_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
    ) -> list[float]:
        """Give the same, to the bit, by the equations as they stand above."""
        matrix, forces = self._equations(angles_rad, rates_rad_s, torques_nm)
        return differences(solve(matrix, forces))

    def braked_accelerations_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
        braked: Sequence[bool],
    ) -> list[float]:
        """Joint accelerations while some joints are braked: theirs are exactly 0.0.

        Braked joints must be at rest. Their torques act within a rigid piece, so they do nothing.
        """
        matrix, forces = self._equations(angles_rad, rates_rad_s, torques_nm)
        return differences(solve_held(matrix, forces, clusters(braked)))

    def braked_rates_rad_s(
        self, angles_rad: Sequence[float], rates_rad_s: Sequence[float], braked: Sequence[bool]
    ) -> list[float]:
        """Joint rates after the brakes have closed at once: those of the braked are exactly 0.0.

        A plastic impact: only braked joints take an impulse, so the momenta conjugate to the free
        angles stay, which makes the new rates the nearest ones in kinetic energy.
        """
        matrix, _ = self._equations(angles_rad, [0.0] * self.size, [0.0] * self.size)
        momenta = product(matrix, list(accumulate(rates_rad_s)))
        return differences(solve_held(matrix, momenta, clusters(braked)))

    def inverse_nm(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        accelerations_rad_s2: Sequence[float],
    ) -> list[float]:
        """M(q) q'' + b(q, q'): the torques of a motion, those that brakes bear included, N m."""
        matrix, forces = self._equations(angles_rad, rates_rad_s, [0.0] * self.size)
        inertial = product(matrix, list(accumulate(accelerations_rad_s2)))
        loads = [a - b for a, b in zip(inertial, forces, strict=True)]
        return list(accumulate(reversed(loads)))[::-1]

    def impulses_nms(
        self, angles_rad: Sequence[float], rate_changes_rad_s: Sequence[float]
    ) -> list[float]:
        """M(q) dq': the angular impulses at the joints that change the rates at once, N m s."""
        matrix, _ = self._equations(angles_rad, [0.0] * self.size, [0.0] * self.size)
        momenta = product(matrix, list(accumulate(rate_changes_rad_s)))
        return list(accumulate(reversed(momenta)))[::-1]

    def push_torques_nm(
        self, angles_rad: Sequence[float], forces_n: Sequence[float]
    ) -> list[float]:
        """Joint torques of horizontal forces, forward positive, at the links' centres of mass.

        J^T F: on the orientation of link i, F_i pulls at its centre of mass and the forces above
        pull at its end, both by cos(theta_i); a joint carries all links above it.
        """
        carried_n = torque_nm = 0.0
        thetas = list(accumulate(angles_rad))
        torques_nm = []
        for i in range(self.size - 1, -1, -1):
            link = self.links[i]
            lever_nm = link.com_m * forces_n[i] + link.length_m * carried_n
            torque_nm += lever_nm * cos(thetas[i])
            carried_n += forces_n[i]
            torques_nm.append(torque_nm)
        return torques_nm[::-1]

    def energy_j(self, angles_rad: Sequence[float], rates_rad_s: Sequence[float]) -> float:
        """Kinetic plus potential energy; potential counts from the ground joint."""
        thetas, omegas = list(accumulate(angles_rad)), list(accumulate(rates_rad_s))
        energy = 0.0
        for i in range(self.size):
            row = self._inertias[i]
            energy += 0.5 * row[i] * omegas[i] ** 2 + self._weights[i] * cos(thetas[i])
            for j in range(i):
                energy += row[j] * cos(thetas[i] - thetas[j]) * omegas[i] * omegas[j]
        return energy

    def com_m(self, angles_rad: Sequence[float]) -> tuple[float, float]:
        """Centre of mass of the chain, (forward, up) of the ground joint."""
        x_m = y_m = theta = 0.0
        for moment, angle in zip(self._moments, angles_rad, strict=True):
            theta += angle
            x_m += moment * sin(theta)
            y_m += moment * cos(theta)
        return x_m / self.mass_kg, y_m / self.mass_kg

    def com_rise_m_s(self, angles_rad: Sequence[float], rates_rad_s: Sequence[float]) -> float:
        """Vertical velocity of the centre of mass."""
        rise = theta = omega = 0.0
        for moment, angle, rate in zip(self._moments, angles_rad, rates_rad_s, strict=True):
            theta += angle
            omega += rate
            rise -= moment * sin(theta) * omega
        return rise / self.mass_kg

    def _equations(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
    ) -> tuple[list[list[float]], list[float]]:
        """Lower triangle of the mass matrix and right-hand side, in orientations of the links."""
        sines: list[float] = []
        cosines: list[float] = []
        squares: list[float] = []
        forces: list[float] = []
        matrix: list[list[float]] = []
        theta = omega = 0.0
        above = [*torques_nm[1:], 0.0]
        for i, row in enumerate(self._inertias):
            theta += angles_rad[i]
            omega += rates_rad_s[i]
            sine, cosine, square = sin(theta), cos(theta), omega * omega
            force = torques_nm[i] - above[i] + self._weights[i] * sine
            entries = []
            for j in range(i):
                inertia = row[j]
                sine_j, cosine_j = sines[j], cosines[j]
                coupling = inertia * (sine * cosine_j - cosine * sine_j)
                entries.append(inertia * (cosine * cosine_j + sine * sine_j))
                force -= coupling * squares[j]
                forces[j] += coupling * square
            entries.append(row[i])
            sines.append(sine)
            cosines.append(cosine)
            squares.append(square)
            matrix.append(entries)
            forces.append(force)
        return matrix, forces
