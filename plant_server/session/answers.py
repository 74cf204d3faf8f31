"""Answers: which torque frames can be the answer of a board to the tick that is open.

Rule: nothing that a frame can hold may hurt whoever reads it later, so numbers that no board can
mean are refused. A torque that is no number is an answer all the same: it is what a diverging body
makes of an honest board, and nobody can wait for a better one.
"""

from protocol.robot.states import COUNTERS, ON_WIRE
from protocol.wire.frames import NO_EPOCH, TICK_MAX, ProtocolError, Reason, TorqueFrame, decode
from protocol.wire.wiring import neighbours

STATES = frozenset(map(int, ON_WIRE))
COUNTED_MAX = 2**63 - 1


def read_answer(
    payload: bytes, *, board: int, boards: int, run_id: int, incarnation: int, tick: int | None
) -> TorqueFrame:
    """Read and check a torque frame, of any tick if `tick` is None. Raises `ProtocolError`."""
    frame = decode(TorqueFrame, payload)
    if frame.run_id != run_id:
        raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
    if frame.incarnation != incarnation:
        raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
    if tick is not None and frame.tick != tick:
        raise ProtocolError(Reason.TICK, f"tick {frame.tick}, not {tick}")
    if frame.enabled not in (0, 1) or frame.state not in STATES:
        raise ProtocolError(Reason.RANGE, f"enabled {frame.enabled}, state {frame.state}")
    if not 0 <= frame.candidate < boards or not NO_EPOCH <= frame.epoch <= TICK_MAX:
        raise ProtocolError(Reason.RANGE, f"candidate {frame.candidate}, epoch {frame.epoch}")
    if not 0 <= frame.round <= TICK_MAX or not 0 <= frame.counted <= COUNTED_MAX:
        raise ProtocolError(Reason.RANGE, f"round {frame.round}, counted {frame.counted}")
    links = len(neighbours(board, boards))
    if not 0 <= frame.counter < len(COUNTERS) or len(frame.links) != links:
        raise ProtocolError(Reason.RANGE, f"counter {frame.counter}, {len(frame.links)} links")
    return frame
