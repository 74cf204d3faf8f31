"""How traces are told: numbers that go on are sent as what is added to them, so they stay short.

Rule: a frame can be read by itself: its first entry is the difference to 0. A lost frame costs its
own ticks and no more.

`Trace` on the wire holds differences where `protocol.wire.trace` says so; everybody else knows it
summed up.
"""

from collections.abc import Iterator

from msgspec.msgpack import Encoder

from protocol.wire.frames import (
    CRC_BYTES,
    FRAME_BYTES_MAX,
    ProtocolError,
    Reason,
    decode,
    encode,
    kind_of,
)
from protocol.wire.trace import LINKS_MAX, LastWord, TakenFrames, TickTrace, Trace

HEAD_BYTES_MAX = 3 + 1 + 9 + 9 + 3
BODY_BYTES_MAX = FRAME_BYTES_MAX - CRC_BYTES - HEAD_BYTES_MAX
_TICK_END, _TIME_END = 2**31, 2**63
"""What slots, ticks and times are below, and not below the negative of."""
_encode = Encoder().encode


class TraceWriter:
    """Collects the ticks of one board into frames."""

    def __init__(self, *, run_id: int, incarnation: int, links: int) -> None:
        assert links <= LINKS_MAX
        self.run_id, self.incarnation = run_id, incarnation
        self._start = _start(links)
        self._before = self._start
        self._differences: list[TickTrace] = []
        self._bytes = 0

    def add(self, lived: TickTrace) -> bytes | None:
        """Take a tick; return a frame with those before it when there is no room for it."""
        difference = _difference(lived, self._before)
        size = len(_encode(difference))
        full = None
        if self._bytes + size > BODY_BYTES_MAX:
            full = self.flush()
            difference = _difference(lived, self._before)
            size = len(_encode(difference))
        self._differences.append(difference)
        self._bytes += size
        self._before = lived
        return full

    def flush(self) -> bytes | None:
        """Return a frame with what there is, if anything."""
        if not self._differences:
            return None
        frame = encode(Trace(self.run_id, self.incarnation, tuple(self._differences)))
        self._differences.clear()
        self._bytes, self._before = 0, self._start
        return frame


def encode_trace(trace: Trace) -> bytes:
    """Write it as `TraceWriter` does; of more turns than fit into a frame, frames on end."""
    writer = TraceWriter(
        run_id=trace.run_id, incarnation=trace.incarnation, links=len(trace.lived[0].taken)
    )
    frames = [writer.add(lived) for lived in trace.lived] + [writer.flush()]
    return b"".join(filter(None, frames))


def decode_trace(payload: bytes) -> Trace:
    """Read a trace and sum it up. Raises `ProtocolError`."""
    trace = decode(Trace, payload)
    links = {len(lived.taken) for lived in trace.lived}
    if len(links) != 1 or max(links) > LINKS_MAX:
        raise ProtocolError(Reason.MALFORMED, f"turns with {sorted(links)} links")
    return trace._replace(lived=tuple(_summed(trace.lived)))


def decode_told(payload: bytes) -> Trace | LastWord:
    """Read what a board has to tell of its time: a trace or a last word. Raises `ProtocolError`."""
    if kind_of(payload) is LastWord:
        return decode(LastWord, payload)
    return decode_trace(payload)


def _start(links: int) -> TickTrace:
    return TickTrace(0, 0, 0, 0, 0, 0, 0, 0, (TakenFrames(0, 0),) * links)


def _difference(now: TickTrace, before: TickTrace) -> TickTrace:
    taken = zip(now.taken, before.taken, strict=True)
    return now._replace(
        slot=now.slot - before.slot,
        woke_us=now.woke_us - before.woke_us,
        seen_tick=now.seen_tick - before.seen_tick,
        taken=tuple(
            TakenFrames(one.newest_tick - then.newest_tick, one.before) for one, then in taken
        ),
    )


def _summed(differences: tuple[TickTrace, ...]) -> Iterator[TickTrace]:
    now = _start(len(differences[0].taken))
    for more in differences:
        taken = zip(now.taken, more.taken, strict=True)
        now = more._replace(
            slot=now.slot + more.slot,
            woke_us=now.woke_us + more.woke_us,
            seen_tick=now.seen_tick + more.seen_tick,
            taken=tuple(
                TakenFrames(one.newest_tick + add.newest_tick, add.before) for one, add in taken
            ),
        )
        ticks = (now.slot, now.seen_tick, *(one.newest_tick for one in now.taken))
        ticks_fit = all(-_TICK_END <= tick < _TICK_END for tick in ticks)
        if not ticks_fit or not -_TIME_END <= now.woke_us < _TIME_END:
            raise ProtocolError(Reason.RANGE, f"slot {now.slot} or its times are too large")
        yield now
