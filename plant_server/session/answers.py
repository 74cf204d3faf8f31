"""Answers: which torque frames can be the answer of a board to the tick that is open.

Rule: nothing that a frame can hold may hurt whoever reads it later, so numbers that no board can
mean are refused. A torque that is no number is an answer all the same: it is what a diverging body
makes of an honest board, and nobody can wait for a better one.
"""

from protocol.wire.frames import ProtocolError, Reason, TorqueFrame, receive
from protocol.wire.wiring import neighbours


def read_answer(
    payload: bytes, *, board: int, boards: int, run_id: int, incarnation: int, tick: int | None
) -> TorqueFrame:
    """Read and check a torque frame, of any tick if `tick` is None. Raises `ProtocolError`."""
    frame, out_of_range = receive(TorqueFrame, payload)
    if frame.run_id != run_id:
        raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
    if frame.incarnation != incarnation:
        raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
    if tick is not None and frame.tick != tick:
        raise ProtocolError(Reason.TICK, f"tick {frame.tick}, not {tick}")
    if out_of_range is not None:
        raise out_of_range
    if frame.candidate >= boards or len(frame.links) != len(neighbours(board, boards)):
        raise ProtocolError(
            Reason.RANGE, f"candidate {frame.candidate}, {len(frame.links)} receipts"
        )
    return frame
