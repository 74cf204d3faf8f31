"""Hearing one neighbour in realtime: the latest frame counts, and nobody is waited for.

Rule 1: of the frames that a neighbour has said since the last period, the newest few are taken,
        once, the oldest first: the newest has the last word, and no sample before it is lost.
Rule 2: a frame that its sender cannot have said yet, or said too long ago, is refused. "Now" is
        what the board knows of the plant's tick, and boards differ in that.
Rule 3: what is taken suffers the faults of its link, as in lockstep. Delays are rounded up to whole
        periods; what a newer frame has overtaken is dropped.

On the wire ticks are the plant's. What comes out of here counts in the board's own periods.
"""

from collections import deque
from typing import NamedTuple

from module_agent.firmware.hearing import UNHEARD_TICKS_MAX, Hearing
from module_agent.firmware.link_model import LinkModel
from protocol.wire.frames import NO_TICK, LinkFrame, Neighbour, ProtocolError, Reason, decode
from protocol.wire.trace import Taken

STALE_PERIODS = 64
"""What was said longer ago is of no use to anybody: a backlog."""
BEFORE_PERIODS_MAX = 63
"""Of what is taken in one period, all was said within so many of the sender's: a trace has no room
for more (`Taken.before`)."""
FRAMES_MAX = 4
"""The newest ones of a neighbour; it says no more in a period unless it is faster, or storms."""
KEPT_MAX = 32
"""So many of the newest frames are kept to be told of when their sender is gone: more than its own
account of its last periods can lack."""
INCARNATIONS_MAX = 2
"""A neighbour, and the one that is about to take its place."""


class Arrived(NamedTuple):
    """A frame, and how it came."""

    frame: LinkFrame
    payload: bytes


class Mailbox(Hearing):
    """The latest word of one neighbour. Used like `Hearing`, with ticks that are own periods."""

    def __init__(
        self,
        link: LinkModel,
        *,
        run_id: int,
        boards: int,
        ticks_per_period: int,
        sender_ticks_per_period: int,
        ahead_ticks_max: int,
    ) -> None:
        super().__init__(link, run_id=run_id, boards=boards)
        self.taken = Taken(NO_TICK, 0)
        self._ticks_per_period = ticks_per_period
        self._sender_ticks_per_period = sender_ticks_per_period
        self._ahead_ticks_max = ahead_ticks_max
        self.kept: deque[bytes] = deque(maxlen=KEPT_MAX)
        """The newest frames that were taken, as they came."""
        self._arrived: dict[int, dict[int, Arrived]] = {}
        """By incarnation and tick."""

    def put(self, payload: bytes) -> int:
        """Take what the network brought; only the newest frames are kept."""
        try:
            frame = decode(LinkFrame, payload)
            self._check(frame)
        except ProtocolError as error:
            self.refused[error.reason] += 1
            return NO_TICK
        frames = self._arrived.setdefault(frame.incarnation, {})
        frames[frame.tick] = Arrived(frame, payload)
        if len(frames) > FRAMES_MAX:
            del frames[min(frames)]
        if len(self._arrived) > INCARNATIONS_MAX:
            del self._arrived[max(self._arrived)]
            self.refused[Reason.INCARNATION] += 1
        return frame.tick

    def take(self, tick: int, neighbour: Neighbour) -> list[LinkFrame]:
        """Hear what arrives in an own period; the oldest first."""
        if neighbour.incarnation != self._incarnation and neighbour.incarnation:
            self._replace(neighbour.incarnation)
        frames = self._arrived.pop(neighbour.incarnation, {})
        current = [
            arrived for _, arrived in sorted(frames.items()) if self._is_current(arrived, tick)
        ]
        self.taken = self.taken._replace(before=0)
        if current:
            newest = current[-1].frame.tick
            ages = {self._age(arrived, newest): arrived for arrived in current}
            used = {age: arrived for age, arrived in ages.items() if age <= BEFORE_PERIODS_MAX}
            if len(used) < len(ages):
                self.refused[Reason.TICK] += len(ages) - len(used)
            self.taken = Taken(newest, sum(1 << (age - 1) for age in used if age))
            for arrived in used.values():
                self.kept.append(arrived.payload)
                self._meet_fate(arrived, tick)
        due = [frame for slot in sorted(self._late) if slot <= tick for frame in self._late[slot]]
        for slot in [slot for slot in self._late if slot <= tick]:
            del self._late[slot]
        heard = [self._use(frame, tick) for frame in due if frame.tick > self.newest_tick]
        self.heard_mask = int(bool(heard))
        return heard

    def _age(self, arrived: Arrived, newest_tick: int) -> int:
        """How many of its sender's periods before the newest one a frame was said."""
        return (newest_tick - arrived.frame.tick) // self._sender_ticks_per_period

    def _check(self, frame: LinkFrame) -> None:
        super()._check(frame)
        if frame.tick % self._sender_ticks_per_period:
            raise ProtocolError(Reason.TICK, f"tick {frame.tick} begins no period")

    def _replace(self, incarnation: int) -> None:
        """Begin anew with another board at the other end."""
        self._incarnation = incarnation
        self._late.clear()
        self.link.restart()
        self.newest_tick, self.taken = NO_TICK, Taken(NO_TICK, 0)
        for gone in [known for known in self._arrived if known < incarnation]:
            del self._arrived[gone]

    def _is_current(self, arrived: Arrived, tick: int) -> bool:
        said_tick, now_tick = arrived.frame.tick, tick * self._ticks_per_period
        if said_tick <= self.taken.newest_tick:
            return False  # Said again, or overtaken on the way: nobody's fault.
        stale = said_tick < now_tick - STALE_PERIODS * self._sender_ticks_per_period
        if stale or said_tick > now_tick + self._ahead_ticks_max:
            self.refused[Reason.TICK] += 1
            return False
        return True

    def _meet_fate(self, arrived: Arrived, tick: int) -> None:
        """Put a frame where it is heard: now, later, twice, or not at all."""
        frame, payload = arrived
        if frame.tick < 0:
            self._late.setdefault(tick, []).append(frame)  # Warm-up knows no faults.
            return
        fate = self.link.fate(frame.tick)
        if fate.flipped_bit is not None:
            self._damage(payload, fate.flipped_bit)
        for late_ticks in fate.late_ticks:
            late_periods = -(-late_ticks // self._ticks_per_period)
            self._late.setdefault(tick + late_periods, []).append(frame)

    def _use(self, frame: LinkFrame, tick: int) -> LinkFrame:
        """Count the frame as heard, and its sample in own periods: the nearest one."""
        period = self._ticks_per_period
        self.newest_tick = frame.tick
        if frame.heard_tick == NO_TICK:
            self.unheard_ticks = UNHEARD_TICKS_MAX
        else:
            unheard = tick - 1 - frame.heard_tick // period
            self.unheard_ticks = min(max(unheard, 0), UNHEARD_TICKS_MAX)
        if frame.sample_tick == NO_TICK:
            return frame
        return frame._replace(sample_tick=(frame.sample_tick + period // 2) // period)
