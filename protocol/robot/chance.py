"""Chance: the one hash from which everything random in a run is drawn.

Rule 1: a draw follows from the run's seed and from what it is for. So no draw disturbs another,
        and a run is as reproducible with noise as without.
Rule 2: the hash is specified, with test vectors, in `protocol/README.md`.

What happens to a link is drawn for (sender, receiver); what happens within a board for the pair
(board, board), which no link has.
"""

from math import cos, log, pi, sqrt

MASK = (1 << 64) - 1
PHASE, JITTER, START_UP, INTERMITTENT = 0, 1, 2, 6
"""What a draw within a board is for. `protocol.robot.sensors` has one number, 3 to 5 or 7 to 15,
for the noise of each reading."""
GARBAGE = 16
"""And one number from here on for each reading."""


def mix(value: int) -> int:
    """One step of SplitMix64 (Steele, Lea, Flood 2014), 64 bits to 64 bits."""
    value = (value + 0x9E3779B97F4A7C15) & MASK
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & MASK
    return value ^ (value >> 31)


def draw(seed: int, sender: int, receiver: int, tick: int, purpose: int) -> int:
    """64 random bits for one purpose at one tick of one directed link."""
    value = mix(seed & MASK)  # So that no link of one seed shares its bits with one of another.
    for part in (sender, receiver, tick, purpose):
        value = mix(value ^ (part & MASK))
    return value


class Chance:
    """What chance does to one board: `draw` with the board for both ends of the link."""

    def __init__(self, *, seed: int, board: int) -> None:
        self._root = mix(mix(mix(seed & MASK) ^ board) ^ board)

    def draw(self, tick: int, purpose: int) -> int:
        """64 random bits."""
        return mix(mix(self._root ^ (tick & MASK)) ^ purpose)

    def uniform(self, tick: int, purpose: int) -> float:
        """0 <= u < 1, all equally likely."""
        return (self.draw(tick, purpose) >> 11) * 2.0**-53

    def normal(self, tick: int, purpose: int) -> float:
        """Mean 0, variance 1 (Box, Muller 1958); never beyond 6.7."""
        bits = self.draw(tick, purpose)
        radius = sqrt(-2.0 * log(((bits >> 32) + 1) * 2.0**-32))
        return radius * cos(2.0 * pi * ((bits & 0xFFFFFFFF) * 2.0**-32))
