"""Lateness: what a board says in a tick that its loop has not finished when the tick ends.

Rule 1: a late board still says one frame to each neighbour and a torque, with the number of the
        tick: the frame is the barrier. But what they hold is what it said in the tick before.
Rule 2: it has gone through the tick all the same. It has sensed, heard and played its round of the
        election; only that nobody learns of it before the next tick.

So a late tick is to a neighbour as if the board's frame had stayed out, and to the motor as if its
command had: it goes on with the last. What was heard of the neighbours, and how long ago, is true.
"""

from module_agent.firmware.frame_writer import Statement
from protocol.robot.clocks import Clock


class Lateness:
    """What a board that is late now and then says: this tick's statement, or the one before."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._last: Statement | None = None

    def statement(self, tick: int, now: Statement) -> Statement:
        """What is said in a tick; they come one after the other."""
        if self._last is None or not self._clock.late(tick):
            self._last = now
        return self._last
