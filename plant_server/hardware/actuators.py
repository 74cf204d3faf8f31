"""Actuators: what the motors make of the torques that boards ask for.

    what a board asks for -> its limit -> whole steps -> rate limit -> lag -> what the foot can bear

Rule 1: a torque that is no number is never applied. The last valid one stands in for it for as many
        ticks as the motor's data sheet says, then none.
Rule 2: an ideal motor costs nothing: it gives what it is asked for, within its limit.
Rule 3: a motor that nobody drives is off, at once: its torque is 0 and it starts again from there.
"""

from collections.abc import Sequence
from math import copysign, exp, fabs, floor, isfinite

from plant_server.body.body import Body
from plant_server.hardware.foot import Foot
from protocol.robot.hardware import IDEAL, FootSheet, MotorSheet

SAFE_TORQUE_NM = 0.0


class Motor:
    """One motor; its only memory is the torque that it gives."""

    def __init__(self, sheet: MotorSheet, *, tick_s: float) -> None:
        self._step_nm = sheet.torque_step_nm
        rate = sheet.torque_rate_nm_s
        self._change_nm_max = None if rate is None else rate * tick_s
        # Exact for a command that stays the same during a tick, as it does.
        self._share = 1.0 - exp(-tick_s / sheet.lag_s) if sheet.lag_s else 1.0
        self._slewed_nm = self._torque_nm = 0.0

    def torque_nm(self, asked_nm: float) -> float:
        """The torque of a tick."""
        if self._step_nm:
            asked_nm = self._step_nm * floor(asked_nm / self._step_nm + 0.5)
        most = self._change_nm_max
        if most is not None:
            asked_nm = min(max(asked_nm, self._slewed_nm - most), self._slewed_nm + most)
        self._slewed_nm = asked_nm
        if self._share == 1.0:
            self._torque_nm = asked_nm
        else:
            self._torque_nm += self._share * (asked_nm - self._torque_nm)
        return self._torque_nm

    def stop(self) -> None:
        """Nobody drives it."""
        self._slewed_nm = self._torque_nm = 0.0


class Actuators:
    """The motors of all joints, and what is asked of them."""

    def __init__(
        self,
        limits_nm: Sequence[float],
        motor_sheets: Sequence[MotorSheet],
        foot: FootSheet | None,
        *,
        tick_s: float,
    ) -> None:
        """One limit for each joint, and a data sheet; without any, all motors are ideal.

        `foot`: None if the ground takes any torque.
        """
        self.saturated = 0
        self.invalid_torques = 0
        self._limits_nm = limits_nm
        self._asked_nm = [0.0] * len(limits_nm)
        self._invalid_ticks = [0] * len(limits_nm)
        sheets = motor_sheets or (IDEAL,) * len(limits_nm)
        self._hold_ticks = [sheet.hold_ticks for sheet in sheets]
        self._motors = {
            joint: Motor(sheet, tick_s=tick_s)
            for joint, sheet in enumerate(sheets)
            if not sheet.ideal
        }
        self._foot = None if foot is None else Foot(foot)
        self.tipping = False
        """Whether the ankle was asked for more than the foot can bear."""

    def ask(self, joint: int, torque_nm: float) -> None:
        """Take what a board asks for: saturated, or in place of no number what stands in for it."""
        if isfinite(torque_nm):
            self._invalid_ticks[joint] = 0
            limit = self._limits_nm[joint]
            if fabs(torque_nm) > limit:
                self.saturated += 1
                torque_nm = copysign(limit, torque_nm)
            self._asked_nm[joint] = torque_nm
            return
        self.invalid_torques += 1
        self._invalid_ticks[joint] += 1
        if self._invalid_ticks[joint] > self._hold_ticks[joint]:
            self._asked_nm[joint] = SAFE_TORQUE_NM

    def forget(self, joint: int) -> None:
        """The board that asked is gone."""
        self._asked_nm[joint] = 0.0
        self._invalid_ticks[joint] = 0

    def torques_nm(self, body: Body, undriven_since: Sequence[int | None]) -> list[float]:
        """The torques of a tick; joints that nobody drives have a tick since when."""
        asked = [
            0.0 if since_tick is not None else asked_nm
            for asked_nm, since_tick in zip(self._asked_nm, undriven_since, strict=True)
        ]
        for joint, motor in self._motors.items():
            if undriven_since[joint] is None:
                asked[joint] = motor.torque_nm(asked[joint])
            else:
                motor.stop()
        if self._foot is not None:
            driven = undriven_since[0] is None
            asked[0] = self._foot.pass_on(asked[0], body) if driven else self._foot.lift()
            self.tipping = self._foot.tipping
        return asked
