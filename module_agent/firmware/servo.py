"""The servo and the gravity compensation of one DEC module (the paper's equation for tau).

    tau = -[ G_g alpha_CoM + G_servo (K_p eps + K_d d(alpha)/dt + K_i integral(eps)) ]

All of it seen through the lumped delay: the board passes samples that are that old. G_g is the
gravity weight times K_p. The error eps is taken to the reference while the board is enabled, and
to the value held since it was disabled while it is not.
"""

from module_agent.firmware.config import BoardConfig
from module_agent.firmware.controller import ServoInput


class Servo:
    """Torque from delayed samples; its only memory is the integral of the error."""

    def __init__(self, config: BoardConfig) -> None:
        self.gains = config.gains
        self.tick_s = config.tick_s
        self.integral_rad_s = 0.0

    def torque_nm(self, seen: ServoInput) -> float:
        """Advance the integral by one tick and return the torque on the joint.

        The integral stands still while the torque is at its limit and the error would push it
        further out.
        """
        error_rad = seen.error_rad
        gains = self.gains
        integral = self.integral_rad_s + error_rad * self.tick_s
        servo = (
            gains.kp_nm_rad * error_rad
            + gains.kd_nm_s_rad * seen.rate_rad_s
            + gains.ki_nm_rad_s * integral
        )
        com_sway_rad = seen.body.supported.sway_rad()
        gravity = gains.gravity_weight * gains.kp_nm_rad * com_sway_rad
        torque = -(gravity + gains.g_servo * servo)
        limit = gains.torque_limit_nm
        if torque > limit:
            outwards, torque = error_rad < 0.0, limit
        elif torque < -limit:
            outwards, torque = error_rad > 0.0, -limit
        else:
            outwards = False
        if not outwards:
            self.integral_rad_s = integral
        return torque


class SlewingServo(Servo):
    """A servo that knows how fast its motor's torque can change, and asks for no more.

    The integral stands still as well while the motor is on its way and the error would send it
    further.
    """

    def __init__(self, config: BoardConfig) -> None:
        super().__init__(config)
        assert config.torque_rate_nm_s is not None, "a motor without one has a plain servo"
        self._change_nm_max = config.torque_rate_nm_s * config.tick_s
        self._asked_nm = 0.0

    def torque_nm(self, seen: ServoInput) -> float:
        """As `Servo.torque_nm`, but within reach of the last torque asked for."""
        before = self.integral_rad_s
        change = super().torque_nm(seen) - self._asked_nm
        most = self._change_nm_max
        if change > most:
            change, outwards = most, seen.error_rad < 0.0
        elif change < -most:
            change, outwards = -most, seen.error_rad > 0.0
        else:
            outwards = False
        if outwards:
            self.integral_rad_s = before
        self._asked_nm += change
        return self._asked_nm


def servo(config: BoardConfig) -> Servo:
    """The servo for the motor of a board."""
    return Servo(config) if config.torque_rate_nm_s is None else SlewingServo(config)
