"""Timing: every tick is told once, to the microsecond, in frames that always fit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.timing import ARRIVALS_MAX, NEVER, TICKS_MAX, BoardTiming
from protocol.process.machine import Effort
from protocol.wire.frames import FRAME_BYTES_MAX, NO_TICK, decode
from protocol.wire.timing import TickTiming, Timing

LAW = settings(max_examples=150, deadline=None, derandomize=True)
RUN, INCARNATION, CLOCK = 2**32 - 1, 70_000, 2**32 - 1
EFFORT = Effort(cpu_us=2**40, memory_kb=2**31)
START_NS = 2**62
FIRST_TICK = -10

STEPS = st.one_of(st.integers(0, 10**6), st.sampled_from([10**8, 65 * 10**6, 10**13]))
"""Nanoseconds from one thing to the next: most are short, some are a frozen board's."""
TICK = st.tuples(STEPS, STEPS, STEPS, st.none() | STEPS, st.none() | STEPS)
"""Steps to what the board did, and how long before taking up its neighbours' frames arrived."""


def begun() -> BoardTiming:
    timing = BoardTiming(clock=CLOCK)
    timing.begin(RUN, INCARNATION)
    return timing


def told(timing: BoardTiming) -> list[Timing]:
    """What is left to say, in frames as they arrive."""
    frames = []
    while timing.ticks:
        payload = timing.frame(EFFORT)
        assert len(payload) <= FRAME_BYTES_MAX
        frames.append(decode(Timing, payload))
    return frames


@LAW
@given(st.lists(TICK, min_size=1, max_size=40), st.integers(-10, 10**6))
def test_every_tick_is_told_once_in_order_and_to_the_microsecond(
    steps: list[tuple[int, int, int, int | None, int | None]], first_tick: int
) -> None:
    timing, stamps, frames, now_ns = begun(), [], [], START_NS
    for tick, (wait, think, speak, *lay) in enumerate(steps, start=first_tick):
        taken_up = now_ns + wait
        decided = taken_up + think
        now_ns = decided + speak
        arrivals = [NEVER if ns is None else taken_up - ns for ns in lay]
        for link, arrived in enumerate(arrivals):
            if arrived != NEVER:
                timing.arrived(link, tick - 1, arrived)
        timing.ticked(tick, taken_up, decided, now_ns)
        stamps.append((taken_up, decided, now_ns, *arrivals))
        if timing.due:
            frames.append(decode(Timing, timing.frame(EFFORT)))
            assert not timing.due
    frames += told(timing)
    tick = first_tick
    for frame in frames:
        assert frame[:2] == (RUN, INCARNATION)
        assert frame[4:7] == (CLOCK, *EFFORT)
        assert frame.tick == tick, "without gaps"
        assert min(time for entry in frame.ticks for time in entry if time != NEVER) == 0
        for entry in frame.ticks:
            for us, ns in zip(entry, stamps[tick - first_tick], strict=True):
                assert us == (NEVER if ns == NEVER else (ns - frame.base_ns) // 1000)
            tick += 1
    assert tick == first_tick + len(steps)


def test_ticks_that_lie_close_together_share_a_frame() -> None:
    """The cost of a frame is that of many ticks, so an ordinary run has few of them."""
    timing = begun()
    for n in range(TICKS_MAX):
        assert not timing.due
        start_ns = START_NS + n * 5_000_000
        timing.arrived(0, n - 1, start_ns - 100_000)
        timing.ticked(n, start_ns, start_ns + 60_000, start_ns + 90_000)
    assert timing.due
    (frame,) = told(timing)
    assert frame.base_ns == START_NS - 100_000
    assert frame.ticks[1] == TickTiming(5100, 5160, 5190, 5000, NEVER)


def test_the_first_copy_of_a_frame_is_when_it_arrived() -> None:
    timing = begun()
    timing.arrived(1, 6, START_NS)
    timing.arrived(1, 7, START_NS + 2000)  # Early: it belongs to the tick after.
    timing.arrived(1, 6, START_NS + 4000)
    timing.ticked(7, START_NS + 5000, START_NS + 6000, START_NS + 7000)
    timing.ticked(8, START_NS + 8000, START_NS + 9000, START_NS + 10_000)
    (frame,) = told(timing)
    assert [entry[3:] for entry in frame.ticks] == [(NEVER, 0), (NEVER, 2)]


@pytest.mark.parametrize("junk", [NO_TICK, FIRST_TICK])
def test_frames_that_nobody_uses_are_forgotten(junk: int) -> None:
    """Refused ones, repeated ones, those of before the admission: and never the newest."""
    timing = begun()
    for n in range(100):
        timing.arrived(0, junk, START_NS)
        timing.arrived(0, junk + n, START_NS)
        assert len(timing._arrivals[0]) <= ARRIVALS_MAX
    timing.arrived(0, 200, START_NS)
    timing.ticked(201, START_NS, START_NS, START_NS)
    assert timing.ticks[-1][3] == START_NS


def test_a_board_that_is_let_in_again_begins_anew() -> None:
    timing = begun()
    timing.arrived(0, 4, START_NS)
    timing.ticked(4, START_NS, START_NS, START_NS)
    timing.begin(RUN, INCARNATION + 1)
    assert told(timing) == []
    timing.ticked(5, START_NS, START_NS, START_NS)
    (frame,) = told(timing)
    assert (frame.incarnation, frame.tick) == (INCARNATION + 1, 5)
    assert frame.ticks[0].first_arrived_us == NEVER
