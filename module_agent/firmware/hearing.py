"""Hearing one neighbour: a bounded mailbox that trusts nothing, and the faults of its link.

Rule 1: said in tick k, heard in tick k+1 at the earliest. What arrives sooner waits here; what
        nobody can have said yet does not.
Rule 2: a frame is used only if its sender is the neighbour that the roster names, and completed
        that tick. A death half way through a tick then has one meaning for everybody (S5).
Rule 3: what cannot be used is counted by its reason and is no data; it never raises.
Rule 4: frames that are here are lost, late, doubled or damaged by the link model, and by nothing
        else: whatever the network did, the run is the same.
"""

from abc import ABC, abstractmethod
from collections import Counter

from module_agent.firmware.link_model import LinkModel
from protocol.wire.frames import (
    NO_TICK,
    UNHEARD_TICKS_MAX,
    LinkFrame,
    Neighbour,
    ProtocolError,
    Reason,
    decode,
    receive,
)

EARLY_TICKS_MAX = 2
"""A neighbour is at most one tick ahead of this board, which has yet to hear the tick before."""
EARLY_FRAMES_MAX = 4
"""A neighbour may be replaced in between; more is a storm."""


class LinkEnd(ABC):
    """This board's end of the link from one neighbour: what it takes, refuses, and knows of it.

    There are two: `Hearing` waits for each tick's frame, `Mailbox` takes the newest ones.
    """

    def __init__(self, link: LinkModel, *, run_id: int, boards: int) -> None:
        self.link = link
        self.run_id = run_id
        self.boards = boards
        self.refused: Counter[Reason] = Counter()
        self.newest_tick = NO_TICK
        """The plant's tick in which the newest frame that was used was said."""
        self.unheard_ticks = 0
        """How many own ticks ago the neighbour last heard this board, by its own words."""
        self.heard_mask = 0
        """Of the last `take`: bit j is the frame said j ticks before the newest possible."""
        self.incarnation = 0
        """Of the neighbour."""

    @abstractmethod
    def put(self, payload: bytes) -> int:
        """Take what the network brought, in any order, any number of times.

        Returns the tick in which it was said, `NO_TICK` if it cannot be used.
        """

    @abstractmethod
    def has(self, tick: int, neighbour: Neighbour) -> bool:
        """Whether the frame that this neighbour said in `tick` is here."""

    @abstractmethod
    def take(self, tick: int, neighbour: Neighbour) -> list[LinkFrame]:
        """Hear: the frames that arrive in an own tick, the newest ones last but for late ones."""

    @abstractmethod
    def check_tick(self, tick: int) -> None:
        """See whether a frame can have been said in this tick. Raises `ProtocolError`."""

    def read(self, payload: bytes) -> LinkFrame | None:
        """Read a frame and check it; one that cannot be used is counted by its reason."""
        try:
            frame, out_of_range = receive(LinkFrame, payload)
            self.check_sender(frame)
            self.check_tick(frame.tick)
            self.check_numbers(frame, out_of_range)
        except ProtocolError as error:
            self.refused[error.reason] += 1
            return None
        return frame

    def check_sender(self, frame: LinkFrame) -> None:
        """See whether a frame can be from the board at the other end. Raises `ProtocolError`."""
        if frame.run_id != self.run_id:
            raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}, not {self.run_id:08x}")
        if frame.incarnation <= 0:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation} is nobody")
        if frame.incarnation < self.incarnation:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation} is gone")

    def check_numbers(self, frame: LinkFrame, out_of_range: ProtocolError | None) -> None:
        """See whether what a frame says can be true of this body. Raises `ProtocolError`."""
        if out_of_range is not None:
            raise out_of_range
        if frame.candidate >= self.boards:
            raise ProtocolError(Reason.RANGE, f"candidate {frame.candidate}")

    def damage(self, payload: bytes, bit: int) -> None:
        """Flip a bit and read the frame as it would have come: it must not pass."""
        damaged = bytearray(payload)
        damaged[bit // 8 % len(payload)] ^= 1 << bit % 8
        try:
            decode(LinkFrame, bytes(damaged))
        except ProtocolError as error:
            self.refused[error.reason] += 1


class Hearing(LinkEnd):
    """Frames from one neighbour, kept until the tick that may use them."""

    def __init__(self, link: LinkModel, *, run_id: int, boards: int) -> None:
        super().__init__(link, run_id=run_id, boards=boards)
        self._waiting: dict[tuple[int, int], tuple[LinkFrame, bytes]] = {}
        self._late: dict[int, list[LinkFrame]] = {}
        self._used_tick = NO_TICK

    def put(self, payload: bytes) -> int:
        """Take what the network brought, as `LinkEnd.put`."""
        frame = self.read(payload)
        if frame is None:
            return NO_TICK
        if frame.tick == self._used_tick:
            return frame.tick  # Said again, as when a link comes back: harmless, nobody's fault.
        self._waiting[frame.tick, frame.incarnation] = frame, payload
        if len(self._waiting) > EARLY_FRAMES_MAX:
            # A board that has yet to be admitted hears the others go on: the newest count. Later
            # nobody can be far ahead.
            waits = self._used_tick == NO_TICK
            del self._waiting[min(self._waiting) if waits else max(self._waiting)]
            self.refused[Reason.TICK] += 1
        return frame.tick

    def has(self, tick: int, neighbour: Neighbour) -> bool:
        """Whether the frame that this neighbour said in `tick` is here."""
        return (tick, neighbour.incarnation) in self._waiting

    def take(self, tick: int, neighbour: Neighbour) -> list[LinkFrame]:
        """Hear: the frames that arrive in `tick`, the late after the one that overtakes them."""
        said_tick = tick - 1
        if neighbour.incarnation != self.incarnation and neighbour.incarnation:
            self.incarnation = neighbour.incarnation
            self._late.clear()
            self.link.restart()
        arrived = self._late.pop(tick, []) if self._late else []
        frame = self._usable(said_tick, neighbour)
        if frame is not None:
            arrived.insert(0, frame)
        self._used_tick = said_tick
        self.heard_mask = 0
        for frame in arrived:
            self.heard_mask |= 1 << (said_tick - frame.tick)
            if frame.tick > self.newest_tick:
                self.newest_tick = frame.tick
                unheard = frame.tick - 1 - frame.heard_tick
                self.unheard_ticks = min(max(unheard, 0), UNHEARD_TICKS_MAX)
        return arrived

    def _usable(self, said_tick: int, neighbour: Neighbour) -> LinkFrame | None:
        """The frame said in the tick before, unless the link model has other plans for it."""
        entry = self._waiting.pop((said_tick, neighbour.incarnation), None)
        if self._waiting:
            self._drop_stale(said_tick)
        if entry is None or said_tick > neighbour.completed_tick:
            return None
        frame, payload = entry
        if said_tick < 0:
            return frame  # Warm-up knows no faults.
        fate = self.link.fate(said_tick)
        if fate.flipped_bit is not None:
            self.damage(payload, fate.flipped_bit)
            return None
        on_time = None
        for late_ticks in fate.late_ticks:
            if late_ticks == 0:
                on_time = frame
            else:
                self._late.setdefault(said_tick + 1 + late_ticks, []).append(frame)
        return on_time

    def _drop_stale(self, said_tick: int) -> None:
        for key in [key for key in self._waiting if key[0] <= said_tick]:
            del self._waiting[key]
            self.refused[Reason.INCARNATION if key[0] == said_tick else Reason.TICK] += 1

    def check_tick(self, tick: int) -> None:
        """See whether it can have been said by now, and not too long ago."""
        if tick < self._used_tick:
            raise ProtocolError(Reason.TICK, f"tick {tick} is past")
        if tick > self._used_tick + EARLY_TICKS_MAX and self._used_tick != NO_TICK:
            raise ProtocolError(Reason.TICK, f"tick {tick} is far ahead")
