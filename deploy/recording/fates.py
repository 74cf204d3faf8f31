"""What became of each link frame, from the receipts in the recording.

Rule 1: a frame was heard when its receiver says so: a torque frame names the frames that were used
        in its tick. Why one was not, the replay knows: it drew what the link model did.
Rule 2: every frame has one fate in the end, and one only, also when its copies came twice.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from deploy.recording.frame_fate import NEVER, FrameFate
from deploy.recording.replay import Link, LinkDraw, ReplayedTick
from protocol.wire.frames import TorqueFrame
from protocol.wire.wiring import neighbours

MASK = 2**64 - 1


class FrameOutcome(NamedTuple):
    """A frame whose fate is known."""

    link: Link
    said_tick: int
    fate: FrameFate
    heard_tick: int
    """When it was used first, or `NEVER`."""


class PendingFrame(NamedTuple):
    """A frame that may yet be heard."""

    incarnation: int
    """Who said it."""
    due_tick: int
    """When it is heard at the latest."""


class FateTracker:
    """Follows every frame of a run of some boards, tick by tick."""

    def __init__(self, boards: int) -> None:
        self._links: list[tuple[Link, int, dict[int, PendingFrame]]] = [
            ((sender, receiver), index, {})
            for receiver in range(boards)
            for index, sender in enumerate(neighbours(receiver, boards))
        ]
        """Each link, its place among those of its receiver, and its frames by the tick said."""

    def tick(
        self, played: ReplayedTick, answers: Sequence[TorqueFrame | None]
    ) -> Iterator[FrameOutcome]:
        """Live through a tick; give the frames whose fate it settles.

        `answers` are the torque frames that were recorded, None where a board did not answer.
        """
        tick = played.record.tick
        for link, index, under_way in self._links:
            sender, receiver = link
            answer = answers[receiver]
            if under_way:
                if answer is None or receiver in played.newcomers:
                    yield from self._all(FrameFate.NOBODY, link, under_way)
                else:
                    yield from _arrive(link, under_way, played, answer.links[index].heard_mask)
            if answers[sender] is not None:
                under_way[tick] = PendingFrame(played.incarnations[sender], tick + 1)
            else:
                there = played.incarnations[sender] != 0
                yield FrameOutcome(link, tick, FrameFate.VOID if there else FrameFate.UNSAID, NEVER)

    def end(self) -> Iterator[FrameOutcome]:
        """Give the frames that nobody could hear before the end of the recording."""
        for link, _, under_way in self._links:
            yield from self._all(FrameFate.PENDING, link, under_way)

    @staticmethod
    def _all(
        fate: FrameFate, link: Link, under_way: dict[int, PendingFrame]
    ) -> Iterator[FrameOutcome]:
        for said_tick in under_way:
            yield FrameOutcome(link, said_tick, fate, NEVER)
        under_way.clear()


def _arrive(
    link: Link, under_way: dict[int, PendingFrame], played: ReplayedTick, heard_mask: int
) -> Iterator[FrameOutcome]:
    """What a receiver used in a tick, and what will not be heard any more."""
    tick = played.record.tick
    heard_mask &= MASK  # A board of another's making may have sent any number.
    while heard_mask:
        ago = heard_mask.bit_length() - 1
        heard_mask ^= 1 << ago
        said_tick = tick - 1 - ago
        if under_way.pop(said_tick, None) is not None:  # Else it is the second of two copies.
            yield FrameOutcome(link, said_tick, FrameFate.LATE if ago else FrameFate.HEARD, tick)
    sender = played.incarnations[link[0]]
    for said_tick, frame in list(under_way.items()):
        fate: FrameFate | None = None
        if said_tick == tick - 1:
            drawn = played.drawn.get(link)
            fate = _unheard(drawn)
            if fate is None and drawn is not None:
                due_tick = tick + max(drawn.fate.late_ticks)
                under_way[said_tick] = frame._replace(due_tick=due_tick)
        elif tick >= frame.due_tick or sender not in (0, frame.incarnation):
            fate = FrameFate.VOID
        if fate is not None:
            del under_way[said_tick]
            yield FrameOutcome(link, said_tick, fate, NEVER)


def _unheard(drawn: LinkDraw | None) -> FrameFate | None:
    """Why a frame was not heard in the tick after it was said; None: it is late."""
    if drawn is None:
        return FrameFate.VOID
    if drawn.fate.late_ticks:
        return None
    if drawn.cut:
        return FrameFate.CUT
    return FrameFate.LOST if drawn.fate.flipped_bit is None else FrameFate.CORRUPT
