"""Hearing one neighbour in realtime: the latest frame counts, and nobody is waited for.

Rule 1: of the frames that a neighbour has said since the last period, the newest few are taken,
        once, the oldest first: the newest has the last word, and no sample before it is lost.
Rule 2: a frame that its sender cannot have said yet, or said too long ago, is refused. "Now" is
        what the board knows of the plant's tick, and boards differ in that.
Rule 3: what is taken suffers the faults of its link, as in lockstep. Delays are rounded up to whole
        periods; what a newer frame has overtaken is dropped.

On the wire ticks are the plant's. What comes out of here counts in the board's own periods, by the
board's `OwnTime`.
"""

from collections import deque
from typing import NamedTuple

from module_agent.firmware.hearing import LinkEnd
from module_agent.firmware.link_model import LinkModel
from module_agent.firmware.own_time.translator import OwnTime
from protocol.wire.frames import (
    NO_TICK,
    UNHEARD_TICKS_MAX,
    LinkFrame,
    Neighbour,
    ProtocolError,
    Reason,
)
from protocol.wire.trace import TakenFrames

STALE_PERIODS = 64
"""What was said longer ago is of no use to anybody: a backlog."""
BEFORE_PERIODS_MAX = 63
"""Of what is taken in one period, all was said within so many of the sender's: a trace has no room
for more (`TakenFrames.before`)."""
FRAMES_MAX = 4
"""The newest ones of a neighbour; it says no more in a period unless it is faster, or storms."""
KEPT_MAX = 32
"""So many of the newest frames are kept to be told of when their sender is gone: more than its own
account of its last periods can lack."""
INCARNATIONS_MAX = 2
"""A neighbour, and the one that is about to take its place."""


class ArrivedFrame(NamedTuple):
    """A frame, and how it came."""

    frame: LinkFrame
    payload: bytes


class Mailbox(LinkEnd):
    """The latest word of one neighbour."""

    def __init__(self, link: LinkModel, own_time: OwnTime, *, run_id: int, boards: int) -> None:
        super().__init__(link, run_id=run_id, boards=boards)
        self.taken = TakenFrames(NO_TICK, 0)
        self.kept: deque[bytes] = deque(maxlen=KEPT_MAX)
        """The newest frames that were taken, as they came."""
        self._own_time = own_time
        self._sender_period_ticks = own_time.cadence.ticks_per_period[link.sender]
        self._arrived: dict[int, dict[int, ArrivedFrame]] = {}
        """By incarnation and tick."""
        self._late: dict[int, list[LinkFrame]] = {}
        """By the own period in which it is heard."""

    def put(self, payload: bytes) -> int:
        """Take what the network brought, as `LinkEnd.put`; only the newest frames are kept."""
        frame = self.read(payload)
        if frame is None:
            return NO_TICK
        frames = self._arrived.setdefault(frame.incarnation, {})
        frames[frame.tick] = ArrivedFrame(frame, payload)
        if len(frames) > FRAMES_MAX:
            del frames[min(frames)]
        if len(self._arrived) > INCARNATIONS_MAX:
            del self._arrived[max(self._arrived)]
            self.refused[Reason.INCARNATION] += 1
        return frame.tick

    def has(self, tick: int, neighbour: Neighbour) -> bool:
        """Whether the frame that this neighbour said in `tick` is here."""
        return tick in self._arrived.get(neighbour.incarnation, {})

    def take(self, tick: int, neighbour: Neighbour) -> list[LinkFrame]:
        """Hear what arrives in an own period; the oldest first."""
        if neighbour.incarnation != self.incarnation and neighbour.incarnation:
            self._replace(neighbour.incarnation)
        frames = self._arrived.pop(neighbour.incarnation, {})
        now_tick = self._own_time.plant_tick(tick)
        current = [
            arrived for _, arrived in sorted(frames.items()) if self._is_current(arrived, now_tick)
        ]
        self.taken = self.taken._replace(before=0)
        if current:
            newest = current[-1].frame.tick
            ages = {self._age(arrived, newest): arrived for arrived in current}
            used = {age: arrived for age, arrived in ages.items() if age <= BEFORE_PERIODS_MAX}
            if len(used) < len(ages):
                self.refused[Reason.TICK] += len(ages) - len(used)
            self.taken = TakenFrames(newest, sum(1 << (age - 1) for age in used if age))
            for arrived in used.values():
                self.kept.append(arrived.payload)
                self._meet_fate(arrived, tick)
        due = [frame for slot in sorted(self._late) if slot <= tick for frame in self._late[slot]]
        for slot in [slot for slot in self._late if slot <= tick]:
            del self._late[slot]
        heard = [self._use(frame, tick) for frame in due if frame.tick > self.newest_tick]
        self.heard_mask = int(bool(heard))
        return heard

    def check_tick(self, tick: int) -> None:
        """See whether it is one in which the sender says something."""
        if tick % self._sender_period_ticks:
            raise ProtocolError(Reason.TICK, f"tick {tick} begins no period")

    def _age(self, arrived: ArrivedFrame, newest_tick: int) -> int:
        """How many of its sender's periods before the newest one a frame was said."""
        return (newest_tick - arrived.frame.tick) // self._sender_period_ticks

    def _replace(self, incarnation: int) -> None:
        """Begin anew with another board at the other end."""
        self.incarnation = incarnation
        self._late.clear()
        self.link.restart()
        self.newest_tick, self.taken = NO_TICK, TakenFrames(NO_TICK, 0)
        for gone in [known for known in self._arrived if known < incarnation]:
            del self._arrived[gone]

    def _is_current(self, arrived: ArrivedFrame, now_tick: int) -> bool:
        said_tick = arrived.frame.tick
        if said_tick <= self.taken.newest_tick:
            return False  # Said again, or overtaken on the way: nobody's fault.
        stale = said_tick < now_tick - STALE_PERIODS * self._sender_period_ticks
        if stale or said_tick > now_tick + self._own_time.cadence.ahead_ticks_max:
            self.refused[Reason.TICK] += 1
            return False
        return True

    def _meet_fate(self, arrived: ArrivedFrame, tick: int) -> None:
        """Put a frame where it is heard: now, later, twice, or not at all."""
        frame, payload = arrived
        if frame.tick < 0:
            self._late.setdefault(tick, []).append(frame)  # Warm-up knows no faults.
            return
        fate = self.link.fate(frame.tick)
        if fate.flipped_bit is not None:
            self.damage(payload, fate.flipped_bit)
        for late_ticks in fate.late_ticks:
            heard_in = tick + self._own_time.whole_periods(late_ticks)
            self._late.setdefault(heard_in, []).append(frame)

    def _use(self, frame: LinkFrame, tick: int) -> LinkFrame:
        """Count the frame as heard; with its sample in own periods."""
        self.newest_tick = frame.tick
        if frame.heard_tick == NO_TICK:
            self.unheard_ticks = UNHEARD_TICKS_MAX
        else:
            unheard = tick - 1 - self._own_time.slot(frame.heard_tick)
            self.unheard_ticks = min(max(unheard, 0), UNHEARD_TICKS_MAX)
        return self._own_time.heard(frame)
