"""The support: what the foot stands on. It may tilt about the ankle, and accelerate forward.

Joint angles count from the links, the ankle's from the support. In the frame of a support that is
tilted by phi and carried forward with the acceleration a, the equations of `Chain` hold with

    orientations   theta_0 = phi + q_0          rates   omega_0 = phi' + q'_0
    torques        tau + J^T (-m a) - M(q) (phi'', 0, ..., 0)

and give the joint accelerations q''; so no writing of the dynamics knows of a support. A foot that
is braked to the support turns with it, as q'_0 = 0.

Rule: a support that is `LEVEL` costs nothing, and adds nothing to any number.
"""

from collections.abc import Sequence
from typing import NamedTuple

from plant_server.body.chain import Chain


class Support(NamedTuple):
    """How the support lies and moves at one moment; its accelerations stay."""

    tilt_rad: float = 0.0
    """From the horizontal, forward (toes down) positive."""
    tilt_rad_s: float = 0.0
    tilt_rad_s2: float = 0.0
    forward_m_s2: float = 0.0
    """Acceleration of the ankle."""

    def ahead(self, time_s: float) -> "Support":
        """The support that much later."""
        return Support(
            self.tilt_rad + time_s * (self.tilt_rad_s + 0.5 * time_s * self.tilt_rad_s2),
            self.tilt_rad_s + time_s * self.tilt_rad_s2,
            self.tilt_rad_s2,
            self.forward_m_s2,
        )

    def angles_rad(self, joints_rad: Sequence[float]) -> list[float]:
        """Joint angles with that of the ankle from the vertical."""
        return [self.tilt_rad + joints_rad[0], *joints_rad[1:]]

    def rates_rad_s(self, joints_rad_s: Sequence[float]) -> list[float]:
        """Joint rates with that of the ankle in space."""
        return [self.tilt_rad_s + joints_rad_s[0], *joints_rad_s[1:]]

    def torques_nm(self, chain: Chain, angles_rad: Sequence[float]) -> list[float]:
        """Joint torques of the inertia of a body that its support accelerates.

        The angles are those from the vertical.
        """
        forces_n = [-link.mass_kg * self.forward_m_s2 for link in chain.links]
        carried_nm = chain.push_torques_nm(angles_rad, forces_n)
        turned_nm = chain.impulses_nms(angles_rad, [self.tilt_rad_s2] + [0.0] * (chain.size - 1))
        return [a - b for a, b in zip(carried_nm, turned_nm, strict=True)]


LEVEL = Support()
"""Level and at rest, for good."""
