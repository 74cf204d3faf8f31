"""Telemetry: what boards tell of themselves besides their torques. Nothing here moves the body.

Rule 1: a board counts since its admission, so another incarnation begins anew.
Rule 2: of a board that has failed, the first report counts; it is an event of the tick in which its
        last part came, which in lockstep is the tick in which the board failed.
"""

from collections import Counter
from typing import NamedTuple

from protocol.robot.states import COUNTERS, Counters, FaultCode
from protocol.wire.frames import Fault, ProtocolError, Reason, receive


class Failure(NamedTuple):
    """What has put a board out of action."""

    code: FaultCode
    text: str

    def __str__(self) -> str:
        what = self.text.partition("\n")[0]
        return f"fault {self.code} ({self.code.title}), {what}"


class Telemetry:
    """Of all boards of one body."""

    def __init__(self, size: int) -> None:
        self.failures: list[Failure | None] = [None] * size
        self.refused = [Counter[Reason]() for _ in range(size)]
        """Frames of each board that the plant has refused, since the run began."""
        self.counted = [[0] * len(COUNTERS) for _ in range(size)]
        """Of each board, the last value told of each counter."""
        self._parts: list[list[str]] = [[] for _ in range(size)]

    def forget(self, board: int) -> None:
        """Begin anew with another incarnation."""
        self.failures[board] = None
        self.counted[board] = [0] * len(COUNTERS)
        self._parts[board] = []

    def counters(self, board: int) -> Counters:
        """What a board counts, as far as it has told."""
        return Counters(*self.counted[board])

    def report(
        self, board: int, payload: bytes, *, run_id: int, incarnation: int, tick: int | None
    ) -> Failure | None:
        """Take one part of a report; the whole, when it was the last. Raises `ProtocolError`.

        `tick` is the only one of which it may be; None: any, for the plant waits for nobody.
        """
        frame, out_of_range = receive(Fault, payload)
        if frame.run_id != run_id:
            raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
        if frame.incarnation != incarnation or incarnation == 0:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
        if tick is not None and frame.tick != tick:
            raise ProtocolError(Reason.TICK, f"tick {frame.tick}, not {tick}")
        if out_of_range is not None:
            raise out_of_range
        if not frame.text.replace("\n", "").isprintable():
            raise ProtocolError(Reason.RANGE, "a text that cannot be printed")
        if frame.part >= frame.parts:
            raise ProtocolError(Reason.RANGE, f"part {frame.part} of {frame.parts}")
        parts = self._parts[board]
        if self.failures[board] is not None or frame.part != len(parts):
            return None
        parts.append(frame.text)
        if len(parts) < frame.parts:
            return None
        failure = self.failures[board] = Failure(FaultCode(frame.code), "".join(parts))
        return failure
