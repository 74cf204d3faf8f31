"""Traces: what a board lived through, tick by tick, on its own clock (S24).

In realtime a board's ticks follow from when things arrived, so each is recorded: what it used, and
when. Ticks are told in batches, off the path to the deadline. From them a run is played again, and
every figure of time is made.

A trace is a frame of kind 8, `[version, 8, run_id, incarnation, links, ...]`, and then for each
tick, one at least, 8 ints and 2 for each link, the fields of `Lived` in order. `slot`, `woke_us`,
`seen_tick` and the ticks of `taken` are told as the difference to the tick before in the same
frame, to 0 in the first. A frame can be read by itself, so a lost one costs its own ticks and no
more.

A board that is killed takes its last ticks along. So whoever finds a neighbour gone tells the last
frames that it took of it, each in a frame of kind 9, `[version, 9, run_id, incarnation, sender,
frame]`.
"""

from collections.abc import Iterator
from enum import IntFlag
from typing import NamedTuple

import msgpack

from protocol.wire.frames import (
    CRC_BYTES,
    FRAME_BYTES_MAX,
    VERSION,
    ProtocolError,
    Reason,
    seal,
    unseal,
)

KIND, KIND_LAST_WORD = 8, 9
LINKS_MAX = 2
HEAD_BYTES_MAX = 3 + 1 + 1 + 9 + 9 + 1
HEAD_FIELDS = 5
BODY_BYTES_MAX = FRAME_BYTES_MAX - CRC_BYTES - HEAD_BYTES_MAX
_FIXED, _PER_LINK = 8, 2
_TICK_END, _TIME_END = 2**31, 2**63
"""What slots, ticks and times are below, and not below the negative of."""


class Mark(IntFlag):
    """What else there is to say of a tick."""

    LATE = 1
    """Its torque was said after the period's end."""
    BEGAN = 2
    """It began an epoch."""
    LATCHED = 4
    """It ended the last round of an epoch."""
    MISSED_EPOCH = 8
    """It came too late to stand for an epoch."""


class Taken(NamedTuple):
    """Which frames of a neighbour a period was played with, faults of the link aside."""

    newest_tick: int
    """When the newest had been said, taken in this period or before; `NO_TICK`: none yet."""
    before: int
    """Bit j: the frame said j + 1 of its sender's periods before that was taken with it."""


class Lived(NamedTuple):
    """One tick of a board."""

    slot: int
    """The board's own period that it is, counted from the release."""
    woke_us: int
    """When it began, on the board's monotonic clock."""
    late_us: int
    """How long after it, or the first of the periods skipped for it, was due."""
    busy_us: int
    """How long until its torque was on the way."""
    phase_us: int
    """Time since the slot began by the plant's ticks, as the board knew them when it woke."""
    seen_tick: int
    """Tick of the observation that it used."""
    skipped: int
    """Periods since the tick before in which the board should have ticked and did not."""
    marks: int
    """`Mark`s."""
    taken: tuple[Taken, ...]
    """Per link. Nothing new was there when `newest_tick` is that of the tick before."""


class Trace(NamedTuple):
    """Some ticks of one board, in order."""

    run_id: int
    incarnation: int
    lived: tuple[Lived, ...]


class LastWord(NamedTuple):
    """A link frame that a board has taken of a neighbour that is gone now."""

    run_id: int
    incarnation: int
    """Of the board that tells it."""
    sender: int
    """Number of the board that is gone."""
    frame: bytes
    """As it came, its CRC included."""


def encode_trace(trace: Trace) -> bytes:
    """Write it as `TraceWriter` does; of more turns than fit into a frame, frames on end."""
    writer = TraceWriter(
        run_id=trace.run_id, incarnation=trace.incarnation, links=len(trace.lived[0].taken)
    )
    frames = [writer.add(lived) for lived in trace.lived] + [writer.flush()]
    return b"".join(filter(None, frames))


class TraceWriter:
    """Collects the ticks of one board into frames."""

    def __init__(self, *, run_id: int, incarnation: int, links: int) -> None:
        assert links <= LINKS_MAX
        self._head = VERSION, KIND, run_id, incarnation, links
        self._start = Lived(0, 0, 0, 0, 0, 0, 0, 0, (Taken(0, 0),) * links)
        self._before = self._start
        self._body = bytearray()
        self._ints = 0
        self._pack = msgpack.Packer().pack

    def add(self, lived: Lived) -> bytes | None:
        """Take a tick; return a frame with those before it when there is no room for it."""
        told = self._told(lived)
        full = None
        if len(self._body) + len(told) > BODY_BYTES_MAX:
            full = self.flush()
            told = self._told(lived)
        self._body += told
        self._ints += _FIXED + _PER_LINK * len(lived.taken)
        self._before = lived
        return full

    def flush(self) -> bytes | None:
        """Return a frame with what there is, if anything."""
        if self._ints == 0:
            return None
        head = b"".join(map(self._pack, self._head))
        count = msgpack.Packer().pack_array_header(len(self._head) + self._ints)
        frame = seal(count + head + bytes(self._body))
        self._body.clear()
        self._ints, self._before = 0, self._start
        return frame

    def _told(self, lived: Lived) -> bytes:
        before = self._before
        numbers = [
            lived.slot - before.slot,
            lived.woke_us - before.woke_us,
            lived.late_us,
            lived.busy_us,
            lived.phase_us,
            lived.seen_tick - before.seen_tick,
            lived.skipped,
            lived.marks,
        ]
        for now, then in zip(lived.taken, before.taken, strict=True):
            numbers += now.newest_tick - then.newest_tick, now.before
        return b"".join(map(self._pack, numbers))


def decode_trace(payload: bytes) -> Trace:
    """Read a trace. Raises `ProtocolError`."""
    fields = unseal(payload)
    if fields[0] != VERSION:
        raise ProtocolError(Reason.VERSION, f"version {fields[0]!r}, this is version {VERSION}")
    ints = all(type(field) is int for field in fields)
    if not ints or len(fields) < HEAD_FIELDS or fields[1] != KIND:
        raise ProtocolError(Reason.MALFORMED, "not a trace")
    run_id, incarnation, links = fields[2:HEAD_FIELDS]
    numbers, size = fields[HEAD_FIELDS:], _FIXED + _PER_LINK * links
    if not 0 <= links <= LINKS_MAX or len(numbers) % size or not numbers:
        raise ProtocolError(Reason.MALFORMED, f"{len(numbers)} numbers for {links} links")
    return Trace(run_id, incarnation, tuple(_lived(numbers, size)))


def encode_last_word(word: LastWord) -> bytes:
    """Write it, CRC-32 included."""
    return seal(msgpack.packb((VERSION, KIND_LAST_WORD, *word)))


def decode_told(payload: bytes) -> Trace | LastWord:
    """Read what a board has to tell of its time: a trace or a last word. Raises `ProtocolError`."""
    fields = unseal(payload)
    if fields[:2] == (VERSION, KIND_LAST_WORD):
        if tuple(map(type, fields[2:])) != (int, int, int, bytes):
            raise ProtocolError(Reason.MALFORMED, "not a last word")
        return LastWord(*fields[2:])
    return decode_trace(payload)


def _lived(numbers: tuple[int, ...], size: int) -> Iterator[Lived]:
    slot = woke_us = seen_tick = 0
    newest = [0] * ((size - _FIXED) // _PER_LINK)
    for start in range(0, len(numbers), size):
        d_slot, d_woke, late, busy, phase, d_seen, skipped, marks, *links = numbers[
            start : start + size
        ]
        slot, woke_us, seen_tick = slot + d_slot, woke_us + d_woke, seen_tick + d_seen
        newest = [now + more for now, more in zip(newest, links[::_PER_LINK], strict=True)]
        ticks_fit = all(-_TICK_END <= tick < _TICK_END for tick in (slot, seen_tick, *newest))
        if not ticks_fit or not -_TIME_END <= woke_us < _TIME_END:
            raise ProtocolError(Reason.RANGE, f"slot {slot} or its times are too large")
        taken = tuple(map(Taken, newest, links[1::_PER_LINK]))
        yield Lived(slot, woke_us, late, busy, phase, seen_tick, skipped, marks, taken)
