"""Storms: frames that come by the thousand and are of no use.

Rule 1: a storm is named, at a bounded rate. Nothing is done about it: what is refused does no harm.
Rule 2: no clock. Whoever looks says what time it is, and in which tick.

A link brings one frame a tick, so a link that is merely bad is no storm, however fast ticks go.
"""

from collections.abc import Mapping
from typing import NamedTuple

from protocol.wire.frames import Reason

LOOK_EVERY_S = 1.0
TELL_EVERY_S = 10.0
PER_S_MAX = 1000.0
PER_TICK_MAX = 4.0
"""A storm is more than both."""

Refused = Mapping[str, Mapping[Reason, int]]
"""How many frames have been refused so far: of what, and why."""


class Storm(NamedTuple):
    """Frames of one origin that are refused."""

    origin: str
    per_s: float
    reason: Reason
    """Why most of them are."""

    def __str__(self) -> str:
        return (
            f"a storm: {self.per_s:,.0f} {self.origin} a second are refused,"
            f" mostly as {self.reason}"
        )


class Storms:
    """Compares counts from time to time."""

    def __init__(self) -> None:
        self.raging: list[Storm] = []
        """Storms between the last two looks."""
        self.due_s = 0.0
        """When to look again."""
        self._seen: dict[str, dict[Reason, int]] = {}
        self._seen_s = self._seen_tick = 0.0
        self._told_s: dict[str, float] = {}

    def look(self, now_s: float, tick: int, refused: Refused) -> list[Storm]:
        """Compare with the last look; returns the storms that are worth a line."""
        elapsed_s = max(now_s - self._seen_s, LOOK_EVERY_S / 2)
        limit = max(PER_S_MAX * elapsed_s, PER_TICK_MAX * (tick - self._seen_tick))
        self.raging = []
        for origin, counts in refused.items():
            seen = self._seen.get(origin)
            if seen is not None:  # Else it is not known how long this took.
                more = {reason: count - seen.get(reason, 0) for reason, count in counts.items()}
                if sum(more.values()) > limit:
                    per_s = sum(more.values()) / elapsed_s
                    self.raging.append(Storm(origin, per_s, max(more, key=more.__getitem__)))
            self._seen[origin] = dict(counts)
        self._seen_s, self._seen_tick, self.due_s = now_s, tick, now_s + LOOK_EVERY_S
        return [storm for storm in self.raging if self._is_news(storm.origin, now_s)]

    def _is_news(self, origin: str, now_s: float) -> bool:
        told_s = self._told_s.get(origin)
        if told_s is not None and now_s - told_s < TELL_EVERY_S:
            return False
        self._told_s[origin] = now_s
        return True
