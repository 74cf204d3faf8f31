"""Lateness: what a board says in a tick that its loop has not finished when the tick ends.

Rule 1: a late board still says one frame to each neighbour and a torque, with the number of the
        tick: the frame is the barrier. But what they hold is what it said in the tick before.
Rule 2: it has lived through the tick all the same. It has sensed, heard and played its round of the
        election; only that nobody learns of it before the next tick.

So a late tick is to a neighbour as if the board's frame had stayed out, and to the motor as if its
command had: it goes on with the last. What was heard of the neighbours, and how long ago, is true.
"""

from collections.abc import Callable, Sequence

from module_agent.firmware.body_view import BodyView
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.election import Gossip
from module_agent.firmware.frame_writer import Doing, Speech
from module_agent.firmware.hearing import Hearing
from protocol.robot.clocks import Clock
from protocol.robot.hardware import STEADY
from protocol.robot.states import State

Seen = tuple[int, tuple[float, ...]]


class Repeated:
    """What is told of the body to one neighbour: this tick's, or in a late one that of before."""

    def __init__(self, seen: Callable[[State], Seen]) -> None:
        self.late = False
        self._seen = seen
        self._last: Seen | None = None

    def __call__(self, state: State) -> Seen:
        """What is told in a tick."""
        if self._last is None or not self.late:
            self._last = self._seen(state)
        return self._last


class LateSpeech(Speech):
    """The mouth of a board that is late now and then."""

    def __init__(
        self,
        config: BoardConfig,
        hearings: Sequence[Hearing],
        view: BodyView,
        *,
        run_id: int,
        incarnation: int,
    ) -> None:
        super().__init__(config, hearings, view, run_id=run_id, incarnation=incarnation)
        self._clock = Clock(
            config.clock, seed=config.seed, board=config.index, tick_s=config.tick_s
        )
        self._repeated = [Repeated(seen) for _, seen in self._links]
        self._links = list(zip(hearings, self._repeated, strict=True))
        self._late = False
        self._gossip: Gossip | None = None
        self._doing: Doing | None = None

    def to_neighbours(self, tick: int, gossip: Gossip, state: State) -> tuple[bytes, ...]:
        """As `Speech.to_neighbours`, of this tick or of the one before."""
        self._late = self._clock.late(tick)
        for seen in self._repeated:
            seen.late = self._late
        if self._gossip is None or not self._late:
            self._gossip = gossip
        return super().to_neighbours(tick, self._gossip, state)

    def to_plant(
        self,
        tick: int,
        gossip: Gossip,
        doing: Doing,
        *,
        counter: int,
        counted: int,
        said: Sequence[bytes],
    ) -> bytes:
        """As `Speech.to_plant`, of this tick or of the one before; always after `to_neighbours`."""
        if self._doing is None or not self._late:
            self._doing = doing
        return super().to_plant(
            tick,
            self._gossip or gossip,
            self._doing,
            counter=counter,
            counted=counted,
            said=said,
        )


def speech(
    config: BoardConfig,
    hearings: Sequence[Hearing],
    view: BodyView,
    *,
    run_id: int,
    incarnation: int,
) -> Speech:
    """The mouth of a board: one that may be late costs more, so only who needs it has it."""
    kind = Speech if config.clock == STEADY else LateSpeech
    return kind(config, hearings, view, run_id=run_id, incarnation=incarnation)
