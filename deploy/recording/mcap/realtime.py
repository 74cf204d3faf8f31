"""What a run in realtime has besides, as messages of `run.mcap`: turns of boards.

Rule: back and forth gives the same frames, to the byte. A turn says how many follow in its frame,
so that it is known where frames begin and end.
"""

from collections.abc import Iterator, Sequence

from deploy.recording.mcap.bodies import Body
from deploy.recording.mcap.realtime_schema import PACE
from protocol.wire.trace import LastWord, TakenFrames, TickTrace, Trace
from protocol.wire.trace_differences import encode_trace


def of_trace(trace: Trace, payload: bytes, ticks_per_period: int) -> Iterator[Body]:
    """The turns of one trace frame, in order."""
    for follow, lived in zip(reversed(range(len(trace.lived))), trace.lived, strict=True):
        body = {
            "run_id": trace.run_id,
            "incarnation": trace.incarnation,
            "tick": lived.slot * ticks_per_period,
            **lived._asdict(),
            "taken": [taken._asdict() for taken in lived.taken],
            "follow": follow,
        }
        if not follow and encode_trace(trace) != payload:  # Foreign, but right, as torques are.
            body["frame_hex"] = payload.hex()
        yield body


def to_frame(turns: Sequence[Body]) -> bytes:
    """The frame of which these are the turns, or the last word; as it was on the wire."""
    last = turns[-1]
    if "frame_hex" in last:
        return bytes.fromhex(last["frame_hex"])
    lived = tuple(
        TickTrace(
            **{name: turn[name] for name in TickTrace._fields[:-1]}, taken=_taken(turn["taken"])
        )
        for turn in turns
    )
    return encode_trace(Trace(last["run_id"], last["incarnation"], lived))


def _taken(links: Sequence[dict[str, int]]) -> tuple[TakenFrames, ...]:
    return tuple(TakenFrames(**link) for link in links)


def of_last_word(word: LastWord, payload: bytes) -> Body:
    """What was heard last of a board."""
    return {
        "run_id": word.run_id,
        "incarnation": word.incarnation,
        "sender": word.sender,
        "frame_hex": payload.hex(),
    }


def to_pace(body: Body) -> dict[str, float]:
    """The plant's account."""
    return {name: float(body[name]) for name in PACE.fields}
