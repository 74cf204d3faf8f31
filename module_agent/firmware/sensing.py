"""A board's own sensors: what is no reading is held for a while, and then it is unsafe to drive.

Rule 1: a value that no body can have is never used (`plausibility` says which). The
        last good one stands in for it for at most 10 ticks; after that the sensors are given up,
        and the board drives no more.
Rule 2: sensors that were given up are back after 50 readings in a row that agree with each other,
        wherever the joint is then. Short of that one good reading is enough.
Rule 3: an observation that holds for several ticks, as it may on a board's own clock, is one
        reading. That it says the same again is no sign of a sensor that is stuck.
Rule 4: after a gap a reading is not compared with the one before it: how the joint has moved
        meanwhile is not known well enough to accuse a sensor.
"""

from module_agent.firmware.body_view import UNKNOWN, AngleAndRate, OwnAngles
from module_agent.firmware.plausibility import FINE, STUCK_RAD, Angle, AngleSheet, ReadingVerdict
from protocol.robot.sensors import EXACT, SensorSheet
from protocol.wire.frames import NO_TICK, Observation

HOLD_TICKS_MAX = 10
BACK_TICKS = 50
STUCK_TORQUE_NM = 1.0
"""No load follows a change of torque so closely that an exact angle stays the same to the bit."""


class Sensing:
    """Readings that can be used."""

    def __init__(
        self,
        sheet: SensorSheet = EXACT,
        *,
        tick_s: float,
        has_imu: bool,
        uneven: bool = False,
    ) -> None:
        self.implausible_samples = 0
        """Readings that were no numbers, or too large."""
        self.inconsistent_samples = 0
        """Angles and rates that contradict each other."""
        self.stuck_samples = 0
        self._joint = Angle(joint_sheet(sheet, uneven=uneven), tick_s=tick_s)
        self._imu = Angle(imu_sheet(sheet, uneven=uneven), tick_s=tick_s) if has_imu else None
        self._last = OwnAngles(UNKNOWN, UNKNOWN)
        """The last good readings."""
        self._judged_tick = NO_TICK
        """The tick that the last reading was taken in."""
        self._held_ticks = 0
        """Since then; or since the sensors were given up."""
        self._good_ticks = 0
        """Good readings in a row since they were."""

    @property
    def safe(self) -> bool:
        """Whether the readings are recent enough to drive on."""
        return self._held_ticks <= HOLD_TICKS_MAX

    def read(self, observation: Observation) -> OwnAngles:
        """The readings of the tick that they were taken in, or those that stand in for them."""
        tick, now = observation.tick, observation.readings
        judged, self._judged_tick = self._judged_tick, tick
        if tick != judged + 1:
            if tick == judged:
                return self._last
            self._joint.skip()
            if self._imu is not None:
                self._imu.skip()
        joint = AngleAndRate(now.joint_rad, now.joint_rad_s)
        imu = AngleAndRate(now.imu_rad, now.imu_rad_s)
        verdict = self._joint.judge(tick, joint[0], joint[1], now.joint_torque_nm)
        if self._imu is not None:
            verdict = max(verdict, self._imu.judge(tick, imu[0], imu[1], joint[0]))
        if verdict is FINE and self._held_ticks == 0:
            self._last = OwnAngles(joint, imu)
        else:
            self._doubt(verdict, OwnAngles(joint, imu))
        return self._last

    def _doubt(self, verdict: ReadingVerdict, now: OwnAngles) -> None:
        """Count what is wrong; hold, give up, or take the sensors back."""
        given_up = not self.safe
        if verdict is FINE:
            self._good_ticks += 1
            if not given_up or self._good_ticks >= BACK_TICKS:
                self._last, self._held_ticks = now, 0
            return
        self._good_ticks = 0
        if given_up:
            self._joint.restart()
            if self._imu is not None:
                self._imu.restart()
        else:
            self._held_ticks += 1
        match verdict:
            case ReadingVerdict.NONSENSE:
                self.implausible_samples += 1
            case ReadingVerdict.INCONSISTENT:
                self.inconsistent_samples += 1
            case _:
                self.stuck_samples += 1


def joint_sheet(sheet: SensorSheet, *, uneven: bool) -> AngleSheet:
    """The encoder and its rate; the witness is the joint's torque."""
    return AngleSheet(
        step_rad=sheet.encoder_step_rad,
        rate_noise_rad_s_per_sqrt_hz=sheet.joint_rate_noise_rad_s_per_sqrt_hz,
        own_rate=not sheet.differentiates,
        uneven=uneven,
        witness_change=STUCK_TORQUE_NM,
    )


def imu_sheet(sheet: SensorSheet, *, uneven: bool) -> AngleSheet:
    """The IMU; the witness is the joint's angle."""
    return AngleSheet(
        noise_rad_per_sqrt_hz=sheet.imu_noise_rad_per_sqrt_hz,
        rate_noise_rad_s_per_sqrt_hz=sheet.imu_rate_noise_rad_s_per_sqrt_hz,
        rate_bias_rad_s=sheet.imu_rate_bias_rad_s,
        uneven=uneven,
        witness_change=STUCK_RAD + 2.0 * sheet.encoder_step_rad,
    )
