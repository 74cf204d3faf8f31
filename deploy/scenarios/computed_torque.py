"""A computed-torque servo: what a board carries is made to move like a damped oscillator.

To the board all that it carries is one mass on its joint, as heavy and where its neighbours say. So
its torque is that mass's inertia times the acceleration that is wanted, less what gravity does.
"""

from module_agent.firmware.config import BoardConfig
from module_agent.firmware.controller import ServoInput

GRAVITY_M_S2 = 9.81
STIFFNESS_PER_S2 = 40.0
DAMPING_PER_S = 12.0


class ComputedTorque:
    """Inverse dynamics of the inverted pendulum that a board takes its body for."""

    def __init__(self, config: BoardConfig) -> None:
        self.limit_nm = config.gains.torque_limit_nm

    def torque_nm(self, seen: ServoInput) -> float:
        """Torque for an acceleration of -(stiffness * error + damping * rate)."""
        mass_kg, x_m, y_m, _x_m_s, _y_m_s = seen.body.supported
        inertia = mass_kg * (x_m * x_m + y_m * y_m)
        wanted_rad_s2 = -(STIFFNESS_PER_S2 * seen.error_rad + DAMPING_PER_S * seen.rate_rad_s)
        torque = inertia * wanted_rad_s2 - mass_kg * GRAVITY_M_S2 * x_m
        return max(-self.limit_nm, min(self.limit_nm, torque))
