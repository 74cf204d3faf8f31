"""What a board knows of the body when nobody is waited for: samples with gaps between them.

Rule 1: a sample bears the period in which the plant took it, whenever it arrived.
Rule 2: where an own sample is missing, the one before holds: between two that did arrive, and for
        up to `hold_ticks_max` periods after the newest. After that it is unsafe to drive.
Rule 3: clocks agree to a period and no better, and boards above that are slower have samples in
        some of the own periods only. To use the newest of theirs, or the one before, is no gap.
"""

from module_agent.firmware.body_view import (
    FORGET_EVERY_TICKS,
    UNKNOWN,
    BodySample,
    BodyView,
    OwnTurns,
)
from protocol.robot.hardware import Link
from protocol.robot.states import State
from protocol.wire.frames import NO_TICK


class RealtimeView(BodyView):
    """A `BodyView` whose ticks are own periods, some of which have passed unseen."""

    def __init__(
        self,
        link: Link,
        *,
        tick_s: float,
        lumped_delay_ticks: int,
        has_imu: bool,
        bottom: bool,
        hold_ticks_max: int,
        pitch: int,
    ) -> None:
        super().__init__(
            link,
            tick_s=tick_s,
            lumped_delay_ticks=lumped_delay_ticks,
            has_imu=has_imu,
            bottom=bottom,
        )
        self.hold_ticks_max = hold_ticks_max
        self.pitch = pitch
        """Own periods between two samples of the slowest board above; 1 if none is slower."""
        self.sampled_slot = 0
        """The period that the readings given to `sense` are of."""
        self._newest = NO_TICK
        self._held = OwnTurns(UNKNOWN, UNKNOWN)
        self._forgotten = NO_TICK

    def forget(self, tick: int) -> None:
        """Drop what is too old to be of use, now and then, also after a leap."""
        before, self._forgotten = self._forgotten, tick - self._kept_ticks
        latest = tick - tick % FORGET_EVERY_TICKS
        if latest - self._kept_ticks > before:
            super().forget(latest)

    def sense(self, tick: int, own: OwnTurns, *, top: bool) -> None:
        """Store own sensors under the period they are of, `sampled_slot`, once."""
        del tick
        sampled, newest = self.sampled_slot, self._newest
        if sampled <= max(newest, self._forgotten):
            return
        if newest != NO_TICK:
            self._hold(sampled)
        self._newest, self._held = sampled, own
        super().sense(sampled, own, top=top)

    def hold_until(self, tick: int) -> None:
        """Let the newest own sample stand for those up to `tick`, but not for ever."""
        if self._newest != NO_TICK:
            self._hold(min(tick, self._newest + self.hold_ticks_max) + 1)

    def at(self, tick: int) -> tuple[BodySample, State]:
        """The sample of `tick`, or the best stand-in for it, and which of these it is."""
        for age in range(self.pitch + 1):
            older = self._complete.get(tick - age)
            if older is not None:
                return older._replace(joint=self._joint.get(tick, older.joint)), State.RUNNING
        return super().at(tick)

    def _hold(self, end: int) -> None:
        """Fill the gap between the newest own sample and `end`."""
        held = self._held
        for missing in range(max(self._newest, self._forgotten) + 1, end):
            if missing not in self._joint:
                self._joint[missing] = held.joint
                if self.has_imu:
                    self._imu[missing] = held.imu
