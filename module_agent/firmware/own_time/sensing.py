"""Own sensors in realtime: readings are judged when they are new, and by the time between them.

Rule 1: an observation that holds for several turns is one reading. That it says the same again is
        no sign of a sensor that is stuck.
Rule 2: after a gap a reading is not compared with the one before it: how the joint has moved
        meanwhile is not known well enough to accuse a sensor.
"""

from module_agent.firmware.body_view import OwnTurns
from module_agent.firmware.sensing import Sensing
from protocol.robot.sensors import EXACT, SensorSheet
from protocol.wire.frames import NO_TICK, Observation


class RealtimeSensing(Sensing):
    """A `Sensing` whose ticks are own periods, some of which have brought no reading."""

    def __init__(self, sheet: SensorSheet = EXACT, *, tick_s: float, has_imu: bool) -> None:
        super().__init__(sheet, tick_s=tick_s, has_imu=has_imu)
        self.sampled_slot: int = NO_TICK
        """The period that the readings given to `read` are of."""
        self._judged_slot: int = NO_TICK

    def read(self, observation: Observation) -> OwnTurns:
        """The readings, or those that stand in for them."""
        sampled, judged = self.sampled_slot, self._judged_slot
        if sampled == judged:
            return self._last
        if sampled != judged + 1:
            self._joint.skip()
            if self._imu is not None:
                self._imu.skip()
        self._judged_slot = sampled
        return super().read(observation._replace(tick=sampled))
