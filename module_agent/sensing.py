"""A board's own sensors: what is no reading is held for a while, and then it is unsafe to drive.

Rule: a value that no body can have is never used. The last plausible one stands in for it for at
most 10 ticks; after that the board drives no more until its sensors are back.
"""

from typing import NamedTuple

from module_agent.body_view import LEVEL, Turn
from protocol.frames import Observation

HOLD_TICKS_MAX = 10
RAD_MAX = 100.0
RAD_S_MAX = 1000.0
"""A joint that turned 16 times, or turns 160 times a second, is a sensor that lies."""


class Readings(NamedTuple):
    """Own sensors in one tick."""

    joint: Turn
    imu: Turn


class Sensing:
    """Readings that can be used."""

    def __init__(self) -> None:
        self.implausible_samples = 0
        self._last = Readings(LEVEL, LEVEL)
        self._held_ticks = 0

    @property
    def safe(self) -> bool:
        """Whether the readings are recent enough to drive on."""
        return self._held_ticks <= HOLD_TICKS_MAX

    def read(self, observation: Observation) -> Readings:
        """This tick's readings, or those that stand in for them."""
        joint = Turn(observation.joint_rad, observation.joint_rad_s)
        imu = Turn(observation.imu_rad, observation.imu_rad_s)
        if _plausible(*joint) and _plausible(*imu):
            self._held_ticks = 0
            self._last = Readings(joint, imu)
        else:
            self._held_ticks += 1
            self.implausible_samples += 1
        return self._last


def _plausible(rad: float, rad_s: float) -> bool:
    """Whether a body can have it; a NaN is neither above nor below."""
    return -RAD_MAX <= rad <= RAD_MAX and -RAD_S_MAX <= rad_s <= RAD_S_MAX
