"""Faults of a directed link, in logical time: what becomes of each frame.

Rule 1: the fate of a frame follows from (seed, sender, receiver, tick said) and the parameters in
        force one tick later. It is drawn by the receiver, from bytes that did arrive: a faulty run
        is as reproducible as a clean one, over any network (S14).
Rule 2: one hash, specified with test vectors in `protocol/README.md`, is all the randomness.
"""

from typing import NamedTuple

from protocol.robot.chance import draw
from protocol.robot.events import PERFECT, LinkParameters

BURST, LOSS, BURST_LOSS, CORRUPT, JITTER, REORDER, DUPLICATE, DUPLICATE_JITTER, BIT = range(9)
"""What a draw is for; each has a number of its own, so that none disturbs another."""


class Fate(NamedTuple):
    """What becomes of one frame."""

    late_ticks: tuple[int, ...]
    """One entry for each copy that arrives: 0 is the tick after it was said. Empty: lost."""
    flipped_bit: int | None = None
    """Which bit of all is flipped, modulo the length of the frame; the receiver will refuse it."""


ON_TIME = Fate((0,))
LOST = Fate(())


class LinkModel:
    """One directed link as its receiver lives through it."""

    def __init__(self, *, seed: int, sender: int, receiver: int, standing: LinkParameters) -> None:
        self.seed = seed
        self.sender = sender
        self.receiver = receiver
        self.parameters = standing
        self._bad = False

    def change(self, parameters: LinkParameters) -> None:
        """Put other parameters in force; a burst that was on is over."""
        self.parameters = parameters
        self._bad = False

    def restart(self) -> None:
        """Begin anew with a new incarnation at the other end."""
        self._bad = False

    def fate(self, said_tick: int) -> Fate:
        """Draw what becomes of the frame said in `said_tick`; ticks come in order."""
        now = self.parameters
        if now == PERFECT:
            return ON_TIME
        if self._lost(said_tick):
            return LOST
        if self._happens(now.corrupt, said_tick, CORRUPT):
            return Fate((), self._draw(said_tick, BIT))
        late = self._late_ticks(said_tick, JITTER)
        late += self._happens(now.reorder, said_tick, REORDER)
        if self._happens(now.duplicate, said_tick, DUPLICATE):
            return Fate((late, self._late_ticks(said_tick, DUPLICATE_JITTER)))
        return Fate((late,))

    def _lost(self, tick: int) -> bool:
        now = self.parameters
        if now.burst_start > 0.0:
            turns = now.burst_end if self._bad else now.burst_start
            self._bad ^= self._happens(turns, tick, BURST)
        if now.cut or self._happens(now.loss, tick, LOSS):
            return True
        return self._bad and self._happens(now.burst_loss, tick, BURST_LOSS)

    def _late_ticks(self, tick: int, purpose: int) -> int:
        jitter = int(self.parameters.jitter_ticks)
        extra = self._draw(tick, purpose) % (jitter + 1) if jitter else 0
        return int(self.parameters.delay_ticks) + extra

    def _happens(self, probability: float, tick: int, purpose: int) -> bool:
        if probability <= 0.0:
            return False
        return (self._draw(tick, purpose) >> 11) * 2.0**-53 < probability

    def _draw(self, tick: int, purpose: int) -> int:
        return draw(self.seed, self.sender, self.receiver, tick, purpose)
