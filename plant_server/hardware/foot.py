"""The foot: how much torque the sole can pass to the ground before it tips.

The foot is flat, massless, and as high as the ankle. A torque tau through the ankle and the weight
F on it put the centre of pressure at -tau / F, forward of the ankle, and pressure can only be under
the sole, from `behind_m` behind the ankle to `ahead_m` ahead of it. So the ground takes

    -F ahead  <=  tau  <=  F behind

and no more. Asked for more the foot would turn about its toes or its heel. Here it stays down, and
the ankle gets what the ground takes: the motor loses the rest, and the plant records from when to
when the foot was *tipping*. F is the mean of the tick before, as the force plate shows it.
"""

from plant_server.body.body import Body
from protocol.robot.hardware import FootSheet


class Foot:
    """One sole on the ground."""

    def __init__(self, sheet: FootSheet) -> None:
        self._sheet = sheet
        self.tipping = False

    def pass_on(self, motor_nm: float, body: Body) -> float:
        """The part of the motor's torque that reaches the ground beside a passive element's."""
        passive_nm = body.passive_nm(0)
        weight_n = max(body.foot_force_n, 0.0)  # A foot in the air passes nothing on.
        total_nm = motor_nm + passive_nm
        least_nm, most_nm = -weight_n * self._sheet.ahead_m, weight_n * self._sheet.behind_m
        self.tipping = not least_nm <= total_nm <= most_nm
        if not self.tipping:
            return motor_nm
        return min(max(total_nm, least_nm), most_nm) - passive_nm

    def lift(self) -> float:
        """Nobody drives the ankle, so no motor works against the sole."""
        self.tipping = False
        return 0.0
