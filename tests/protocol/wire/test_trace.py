"""Traces: what is told of a board's ticks is read back, in frames that always fit."""

import json
import re
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.wire import keys
from protocol.wire.frames import (
    FRAME_BYTES_MAX,
    KINDS,
    NO_TICK,
    VERSION,
    ProtocolError,
    Reason,
    TorqueFrame,
    decode,
    encode,
    seal,
)
from protocol.wire.trace import LastWord, TakenFrames, TickTrace, Trace
from protocol.wire.trace_differences import TraceWriter, decode_told, decode_trace

RUN = 2**31 + 5
TRACE, LAST_WORD = KINDS[Trace], KINDS[LastWord]
TICKS = st.integers(-(2**31), 2**31 - 1)
SPANS = st.integers(-(2**40), 2**40)


def lived(links: int) -> st.SearchStrategy[TickTrace]:
    return st.builds(
        TickTrace,
        slot=TICKS,
        woke_us=st.integers(0, 2**62),
        late_us=SPANS,
        busy_us=SPANS,
        phase_us=SPANS,
        seen_tick=TICKS,
        skipped=st.integers(0, 2**31),
        marks=st.integers(0, 15),
        taken=st.tuples(*[st.builds(TakenFrames, TICKS, st.integers(0, 2**62))] * links),
    )


def told(ticks: list[TickTrace], links: int) -> list[bytes]:
    writer = TraceWriter(run_id=RUN, incarnation=3, links=links)
    frames = [writer.add(tick) for tick in ticks] + [writer.flush()]
    assert writer.flush() is None, "nothing is told twice"
    return [frame for frame in frames if frame is not None]


@given(st.data())
@pytest.mark.parametrize("links", [0, 1, 2])
def test_what_was_lived_through_is_read_back(links: int, data: st.DataObject) -> None:
    ticks = data.draw(st.lists(lived(links), max_size=20))
    frames = told(ticks, links)
    assert all(len(frame) <= FRAME_BYTES_MAX for frame in frames)
    traces = [decode_trace(frame) for frame in frames]
    assert [tick for trace in traces for tick in trace.lived] == ticks
    assert {(trace.run_id, trace.incarnation) for trace in traces} <= {(RUN, 3)}


def steady(ticks: int) -> list[TickTrace]:
    """A board at 500 Hz as it usually is."""
    return [
        TickTrace(n, 10**12 + 2000 * n, 80, 310, 700, 2 * n, 0, 0, (TakenFrames(2 * n - 2, 0),) * 2)
        for n in range(ticks)
    ]


def test_a_frame_has_room_for_many_usual_ticks() -> None:
    frames = told(steady(500), 2)
    assert len(frames) <= 500 / 9


def test_a_lost_frame_costs_its_own_ticks_only() -> None:
    ticks = steady(100)
    first, second, *_ = told(ticks, 2)
    count = len(decode_trace(first).lived)
    found = decode_trace(second)
    assert found == Trace(RUN, 3, tuple(ticks[count : count + len(found.lived)]))


def test_nothing_new_is_the_same_tick_again() -> None:
    tick = TickTrace(1, 5, 0, 0, 0, 2, 0, 0, (TakenFrames(NO_TICK, 0), TakenFrames(4, 1)))
    (frame,) = told([tick, tick], 2)
    assert [one.taken for one in decode_trace(frame).lived] == [tick.taken] * 2


def sealed(*fields: Any) -> bytes:
    return seal(msgpack.packb(fields))


def a_slot(slot: int = 0, woke_us: int = 0, *links: list[int]) -> list[Any]:
    return [slot, woke_us, 0, 0, 0, 0, 0, 0, list(links)]


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", Reason.SIZE),
        (bytes(300), Reason.SIZE),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot()]])[:-1] + b"\x00", Reason.CORRUPT),
        (sealed(VERSION - 1, TRACE, [RUN, 1, [a_slot()]]), Reason.VERSION),
        (sealed(VERSION, 3, [RUN, 1, [a_slot()]]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, 1]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, []]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot(1, 0, *[[0, 0]] * 3)]]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot(1, 0, [0, 0]), a_slot()]]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, [[1.0] * 8 + [[]]]]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, True, [a_slot()]]), Reason.MALFORMED),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot(2**31)]]), Reason.RANGE),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot(0, 2**62)] * 2]), Reason.RANGE),
        (sealed(VERSION, TRACE, [RUN, 1, [a_slot(0, 0, [-(2**31) - 1, 0])]]), Reason.RANGE),
    ],
)
def test_what_is_no_trace_is_refused(payload: bytes, reason: Reason) -> None:
    with pytest.raises(ProtocolError) as refused:
        decode_trace(payload)
    assert refused.value.reason is reason


def test_a_trace_is_no_other_frame() -> None:
    (frame,) = told(steady(1), 2)
    with pytest.raises(ProtocolError):
        decode(TorqueFrame, frame)


def vectors() -> list[dict[str, Any]]:
    readme = Path(keys.__file__).parents[1].joinpath("README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```json traces\n(.*?)^```", readme, re.DOTALL | re.MULTILINE)
    found: list[dict[str, Any]] = json.loads(block)
    return found


@pytest.mark.parametrize("vector", vectors(), ids=lambda vector: vector["about"])
def test_a_vector_of_the_specification_holds_in_both_directions(vector: dict[str, Any]) -> None:
    values, frame = vector["values"], bytes.fromhex(vector["frame"])
    if vector["kind"] == "LastWord":
        values["frame"] = bytes.fromhex(values["frame"])
        assert decode_told(frame) == LastWord(**values)
        assert encode(LastWord(**values)) == frame
        return
    ticks = [
        TickTrace._make([*numbers, tuple(TakenFrames(*link) for link in links)])
        for *numbers, links in values["lived"]
    ]
    run_id, incarnation = values["run_id"], values["incarnation"]
    assert decode_told(frame) == Trace(run_id, incarnation, tuple(ticks))
    writer = TraceWriter(run_id=run_id, incarnation=incarnation, links=2)
    assert [writer.add(tick) for tick in ticks] == [None, None]
    assert writer.flush() == frame


def test_a_last_word_holds_the_largest_link_frame() -> None:
    most = LastWord(2**32 - 1, 2**63 - 1, 2**31, bytes(160))
    payload = encode(most)
    assert len(payload) <= FRAME_BYTES_MAX
    assert decode_told(payload) == most


@pytest.mark.parametrize(
    "fields", [(1, 2, 3), (1, 2, 3, "frame"), (1, 2, 3.0, b""), (1, 2, 3, b"", 4)]
)
def test_what_is_no_last_word_is_refused(fields: tuple[Any, ...]) -> None:
    with pytest.raises(ProtocolError) as refused:
        decode_told(sealed(VERSION, LAST_WORD, fields))
    assert refused.value.reason is Reason.MALFORMED
