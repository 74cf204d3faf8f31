"""What a board knows of the body, sample by sample, and what it makes of gaps (S9).

Rule 1: samples are named by the tick in which they were taken. Only values of one tick are joined.
Rule 2: when a sample is missing, go on: hold the newest older one for up to 5 ticks, extrapolate it
        by its rates for up to 20 more, then take all above for rigid and reckon from the foot up.
Rule 3: in lockstep every own sample is there. On a clock of its own a board misses some: then the
        one before holds, between two that did arrive, and for up to `hold_ticks_max` ticks after
        the newest. After that it is unsafe to drive.
Rule 4: clocks agree to a period and no better, and boards above that are slower have samples in
        some of the own periods only. To use the newest of theirs, `pitch` periods old at most, is
        no gap.

A board's own sensors give its joint. The orientation of its link comes from its own IMU, or from
the board above (its orientation minus the joint between), and so does the mass that it carries.
"""

from typing import Any, NamedTuple

from module_agent.firmware.kinematics import (
    NOTHING,
    CarriedMass,
    CarriedShape,
    add_link,
    carried_rigidly,
    shape_of,
)
from protocol.robot.hardware import Link
from protocol.robot.states import State
from protocol.wire.frames import NO_TICK, LinkFrame

HOLD_TICKS_MAX = 5
EXTRAPOLATE_TICKS_MAX = 20
GAP_TICKS_MAX = HOLD_TICKS_MAX + EXTRAPOLATE_TICKS_MAX
FORGET_EVERY_TICKS = 32
LATENESS_TICKS_MAX = 64
"""A frame that is later than this says nothing of use any more."""


class AngleAndRate(NamedTuple):
    """An orientation or joint angle, and its rate."""

    rad: float
    rad_s: float


LEVEL = AngleAndRate(0.0, 0.0)
"""The foot stands still on a fixed support (paper, section III-B)."""
UNKNOWN = AngleAndRate(0.0, 0.0)
"""Stands in for an angle before its first reading."""


class OwnAngles(NamedTuple):
    """What a board's own sensors say of angles in one tick."""

    joint: AngleAndRate
    imu: AngleAndRate
    support: AngleAndRate = LEVEL
    """How the foot lies and turns; it counts at the bottom of the chain alone."""


class BodySample(NamedTuple):
    """The body as of one tick: this board's joint and link, and all that the joint carries."""

    joint: AngleAndRate
    link: AngleAndRate
    supported: CarriedMass

    @property
    def sway(self) -> AngleAndRate:
        """Angle of the carried centre of mass from the vertical through the joint, and its rate."""
        return AngleAndRate(self.supported.sway_rad(), self.supported.sway_rad_s())


class BodyView:
    """Own samples joined with what the neighbours said about the same tick."""

    def __init__(
        self,
        link: Link,
        *,
        tick_s: float,
        lumped_delay_ticks: int,
        has_imu: bool,
        bottom: bool,
        hold_ticks_max: int = 0,
        pitch: int = 0,
    ) -> None:
        self.link = link
        self.tick_s = tick_s
        self.has_imu = has_imu
        self.bottom = bottom
        self.lumped_delay_ticks = lumped_delay_ticks
        self.hold_ticks_max = hold_ticks_max
        """How long an own sample stands for those that are missing; 0: none is ever missing."""
        self.pitch = pitch
        """Own periods between two samples of the slowest board above; 0: all are in step."""
        self._kept_ticks = lumped_delay_ticks + GAP_TICKS_MAX + LATENESS_TICKS_MAX
        self._joint: dict[int, AngleAndRate] = {}
        self._imu: dict[int, AngleAndRate] = {}
        self._lower: dict[int, AngleAndRate] = {}
        self._complete: dict[int, BodySample] = {}
        self._newest = NO_TICK
        """The newest own sample, and what it was."""
        self._newest_own = OwnAngles(UNKNOWN, UNKNOWN)
        self._forgotten = NO_TICK
        """Samples up to here are of no use any more; they are dropped in `_forget_tick`."""
        self._forget_tick = NO_TICK
        self._newest_complete = NO_TICK
        self._newest_lower = NO_TICK
        self._last_lower = UNKNOWN
        self._shape: CarriedShape | None = None

    def advance(self, tick: int) -> None:
        """Begin a tick, also after a leap: fill in own samples that did not come, drop old ones."""
        if self.hold_ticks_max and self._newest != NO_TICK:
            wanted = tick - self.lumped_delay_ticks
            self._hold(min(wanted, self._newest + self.hold_ticks_max) + 1)
        self._forgotten = tick - self._kept_ticks
        if tick >= self._forget_tick:
            latest = tick - tick % FORGET_EVERY_TICKS
            self._forget_tick = latest + FORGET_EVERY_TICKS
            expired = latest - self._kept_ticks
            stores: tuple[dict[int, Any], ...] = self._joint, self._imu, self._lower, self._complete
            for store in stores:
                for old in [sample_tick for sample_tick in store if sample_tick <= expired]:
                    del store[old]

    def sense(self, sampled: int, own: OwnAngles, *, top: bool) -> None:
        """Store own sensors of the tick in which they were sampled, once.

        At the top of the chain they are a complete sample.
        """
        if sampled <= max(self._newest, self._forgotten):
            return
        if self.hold_ticks_max and self._newest != NO_TICK:
            self._hold(sampled)
        self._newest, self._newest_own = sampled, own
        self._joint[sampled] = own.joint
        if self.has_imu:
            self._imu[sampled] = own.imu
        if self.bottom:
            self._store_lower(sampled, own.support)
        if top and self.has_imu:
            self._complete_sample(sampled, own.imu, NOTHING)

    def hear_from_above(self, frame: LinkFrame) -> None:
        """Join what the board above said with this board's own sample of the same tick."""
        tick = frame.sample_tick
        if tick not in self._joint:
            return
        heard = AngleAndRate(frame.lower_link_rad, frame.lower_link_rad_s)
        above = CarriedMass(*frame[-5:])
        self._complete_sample(tick, self._imu.get(tick, heard), above)

    def hear_from_below(self, frame: LinkFrame) -> None:
        """Store the orientation of the link below, reckoned by encoders from the foot up."""
        if frame.sample_tick in self._joint:
            self._store_lower(
                frame.sample_tick, AngleAndRate(frame.lower_link_rad, frame.lower_link_rad_s)
            )

    def sampled(self, tick: int) -> bool:
        """Whether this board's own sensors were read in `tick`."""
        return tick in self._joint

    def at(self, tick: int) -> tuple[BodySample, State]:
        """The sample of `tick`, or the best stand-in for it, and which of these it is."""
        own = self._joint.get(tick)
        sample = self._complete.get(tick)
        if sample is not None and own is sample.joint:
            return sample, State.RUNNING
        for age in range(max(self.pitch, GAP_TICKS_MAX) + 1):
            older = self._complete.get(tick - age)
            if older is None:
                continue
            held = older if own is None or own is older.joint else older._replace(joint=own)
            if age <= self.pitch:
                return held, State.RUNNING
            if age <= HOLD_TICKS_MAX:
                return held, State.HOLDING
            return self._extrapolated(held, age * self.tick_s), State.EXTRAPOLATING
        return self._reckoned(tick), State.RECKONING

    def for_below(self, state: State) -> tuple[int, BodySample | None]:
        """The newest sample for the board below, and its tick; reckoned when this board has to."""
        if state is not State.RECKONING:
            return self._newest_complete, self._complete.get(self._newest_complete)
        if self._newest_lower not in self._joint:
            return NO_TICK, None
        return self._newest_lower, self._reckoned(self._newest_lower)

    def for_above(self) -> tuple[int, AngleAndRate]:
        """The newest orientation of this board's link by encoders from the foot up."""
        tick = self._newest_lower
        if tick not in self._joint:
            return NO_TICK, UNKNOWN
        lower, joint = self._last_lower, self._joint[tick]
        return tick, AngleAndRate(lower.rad + joint.rad, lower.rad_s + joint.rad_s)

    def _complete_sample(self, tick: int, link: AngleAndRate, above: CarriedMass) -> None:
        supported = add_link(self.link, link.rad, link.rad_s, above)
        self._complete[tick] = BodySample(self._joint[tick], link, supported)
        if tick >= self._newest_complete:
            self._newest_complete = tick
            self._shape = shape_of(above, link.rad)

    def _store_lower(self, tick: int, lower: AngleAndRate) -> None:
        self._lower[tick] = lower
        if tick >= self._newest_lower:
            self._newest_lower, self._last_lower = tick, lower

    def _extrapolated(self, sample: BodySample, ahead_s: float) -> BodySample:
        def turned(turn: AngleAndRate) -> AngleAndRate:
            return AngleAndRate(turn.rad + turn.rad_s * ahead_s, turn.rad_s)

        mass, x_m, y_m, x_m_s, y_m_s = sample.supported
        moved = CarriedMass(mass, x_m + x_m_s * ahead_s, y_m + y_m_s * ahead_s, x_m_s, y_m_s)
        return sample._replace(link=turned(sample.link), supported=moved)

    def _reckoned(self, tick: int) -> BodySample:
        joint = self._joint[tick]
        lower = self._lower.get(tick, self._last_lower)
        link = self._imu.get(tick) or AngleAndRate(lower.rad + joint.rad, lower.rad_s + joint.rad_s)
        above = NOTHING
        if self._shape is not None:
            above = carried_rigidly(self._shape, link.rad, link.rad_s)
        return BodySample(joint, link, add_link(self.link, link.rad, link.rad_s, above))

    def _hold(self, end: int) -> None:
        """Fill the gap between the newest own sample and `end` with that sample."""
        held = self._newest_own
        for missing in range(max(self._newest, self._forgotten) + 1, end):
            if missing not in self._joint:
                self._joint[missing] = held.joint
                if self.has_imu:
                    self._imu[missing] = held.imu
