"""Plausibility: which readings of an angle and its rate a sensor that works cannot have made.

    nonsense        no number, or more turns than a joint has
    inconsistent    the angle is not where the rate says that it has gone: one of them lies, be it
                    that the angle has jumped or that the rate says anything at all
    stuck           the angle is the same to the bit, while something else says that the joint turns

Rule 1: a sensor that works is not accused, unless a joint turns at 40 rad/s: there is room for the
        steps, noise and bias of its data sheet, and a body that stands still to the bit is no
        witness against its sensors.
Rule 2: a reading that says nothing wrong passes by a sum and some comparisons. Thinking begins with
        a doubt, or when the same number comes again.

What the rate makes of an angle is kept as one number, `off`: how far the angle is from where the
rate has taken it. Between two readings the joint has turned by something between what the one rate
and what the other says: a brake may have stopped it at any time. What is beyond that adds up, and
fades away in an eighth of a second, so that small errors of the rate do not. While there is a doubt
it does not fade: an angle that comes back from a glitch is where it should be.

A rate that is the encoder's own difference is no second opinion. Then an angle is inconsistent when
it is farther from the last than a joint can turn. And a stuck encoder with steps, whose rate is its
own difference, is not told from a joint that stands still.
"""

from enum import IntEnum
from math import fabs, inf, isnan, nan, sqrt
from typing import NamedTuple

RAD_MAX = 100.0
RAD_S_MAX = 1000.0
"""A joint that turned 16 times, or turns 160 times a second, is a sensor that lies."""
JUMP_RAD_S_MAX = 100.0
"""No joint turns so fast."""
LEAP_RAD_S2_MAX = 1e4
"""While a sensor is in doubt its rate must not change faster: garbage would agree by luck."""
OFF_RAD = 1e-3
OFF_RAD_S = 2.5
"""How far an exact angle may be from where its exact rate has taken it, and so much more in a tick
of a second: a body that flails turns unevenly within a tick."""
FADES_S = 0.128
NOISE_DEVIATIONS = 10.0
"""Noise is never so many standard deviations large (`protocol.robot.chance.Chance.normal`: 6.7)."""
UNEVEN_RAD_S = 20.0
"""Readings taken at uneven times differ by the turning in between, up to this rate."""
STUCK_RAD = 1e-4
"""An angle may stay the same to the bit while the joint turns by so much, and by two steps."""
STUCK_TICKS = 20
"""A witness is heard when the angle has stayed the same for so long."""
WINDOW_TICKS = 250
"""Evidence that an angle is stuck is forgotten after so long."""
NEVER_TICKS = 10**9
"""Since the last good reading, before there was any: the first may be anywhere."""


class ReadingVerdict(IntEnum):
    """What is wrong with a reading, the worst last."""

    FINE = 0
    STUCK = 1
    INCONSISTENT = 2
    NONSENSE = 3


FINE = ReadingVerdict.FINE


class AngleSheet(NamedTuple):
    """An angle and its rate, as the data sheet has them. All zero: exact."""

    step_rad: float = 0.0
    noise_rad_per_sqrt_hz: float = 0.0
    rate_noise_rad_s_per_sqrt_hz: float = 0.0
    rate_bias_rad_s: float = 0.0
    own_rate: bool = True
    """The rate is measured by a sensor of its own."""
    uneven: bool = False
    """Readings are not taken exactly a tick apart."""
    witness_change: float = 1.0
    """How much a witness must change, while the angle stays the same, to be believed."""


class Angle:
    """One angle sensor with its rate, judged tick by tick."""

    def __init__(self, sheet: AngleSheet, *, tick_s: float) -> None:
        self._jump_rad = JUMP_RAD_S_MAX * tick_s
        self._slack_rad = _slack_rad(sheet, tick_s) if sheet.own_rate else self._jump_rad
        self._slack_rad += 1.5 * sheet.step_rad
        self._half_s = 0.5 * tick_s if sheet.own_rate else 0.0
        self._keeps_trusted = max(0.0, 1.0 - tick_s / FADES_S) if sheet.own_rate else 0.0
        self._keeps_doubted = 1.0 if sheet.own_rate else 0.0
        self._keeps = self._keeps_doubted
        noise_rad_s = NOISE_DEVIATIONS * sheet.rate_noise_rad_s_per_sqrt_hz * sqrt(2.0 / tick_s)
        leap_rad_s = LEAP_RAD_S2_MAX * tick_s + noise_rad_s
        self._leap_rad_s = leap_rad_s if sheet.own_rate else inf
        self._stillness = Stillness(sheet, tick_s=tick_s)
        self._rad, self._rad_s = nan, 0.0
        self._off_rad = 0.0
        self._good_rad = 0.0
        self._ticks = NEVER_TICKS
        """Since the last good reading, which was `good_rad`."""
        self._room_rad = -1.0
        """What may be passed without thinking: the slack, or nothing while there is a doubt."""

    def judge(self, tick: int, rad: float, rad_s: float, witness: float) -> ReadingVerdict:
        """Judge the reading of a tick; to be called in every tick.

        A `witness` is a reading that cannot change while an exact angle stays the same to the bit.
        """
        beyond_rad = self._half_s * (rad_s + self._rad_s) - (rad - self._rad)
        between_rad = self._half_s * fabs(rad_s - self._rad_s)
        if beyond_rad > between_rad:
            beyond_rad -= between_rad
        elif beyond_rad < -between_rad:
            beyond_rad += between_rad
        elif -between_rad <= beyond_rad:  # Not so of a NaN.
            beyond_rad = 0.0
        off_rad = self._keeps * self._off_rad + beyond_rad
        if (
            -self._room_rad <= off_rad <= self._room_rad
            and rad != self._rad
            and -RAD_S_MAX <= rad_s <= RAD_S_MAX
        ):
            self._off_rad, self._rad, self._rad_s = off_rad, rad, rad_s
            return FINE
        doubted = self._room_rad < 0.0
        if not doubted:
            self._good_rad, self._ticks, self._room_rad = self._rad, 0, -1.0
            self._keeps = self._keeps_doubted
        self._ticks += 1
        leaps = doubted and fabs(rad_s - self._rad_s) > self._leap_rad_s and not isnan(self._rad)
        verdict = self._considered(tick, rad, rad_s, witness, off_rad)
        if verdict is FINE and leaps:
            verdict = ReadingVerdict.INCONSISTENT
        if verdict is FINE:
            self._room_rad, self._keeps = self._slack_rad, self._keeps_trusted
        return verdict

    def restart(self) -> None:
        """Judge anew from the last reading on, wherever that is: none before it counts any more."""
        self._off_rad, self._ticks = 0.0, NEVER_TICKS

    def skip(self) -> None:
        """Compare the next reading with none: readings are missing before it."""
        self._rad = nan

    def _considered(
        self, tick: int, rad: float, rad_s: float, witness: float, off_rad: float
    ) -> ReadingVerdict:
        if not (-RAD_MAX <= rad <= RAD_MAX and -RAD_S_MAX <= rad_s <= RAD_S_MAX):
            self._rad = nan  # The next reading has nothing to be compared with.
            return ReadingVerdict.NONSENSE
        same = rad == self._rad
        self._off_rad = 0.0 if isnan(self._rad) else off_rad
        self._rad, self._rad_s = rad, rad_s
        reach_rad = self._jump_rad * self._ticks + self._slack_rad
        if fabs(self._off_rad) > self._slack_rad or fabs(rad - self._good_rad) > reach_rad:
            return ReadingVerdict.INCONSISTENT
        if same and self._stillness.stuck(tick, rad_s, witness):
            return ReadingVerdict.STUCK
        return FINE


class Stillness:
    """An angle that stays the same to the bit, and what its rate and a witness say meanwhile."""

    def __init__(self, sheet: AngleSheet, *, tick_s: float) -> None:
        self._tick_s = tick_s
        window_s = WINDOW_TICKS * tick_s
        noise_rad = NOISE_DEVIATIONS * sheet.rate_noise_rad_s_per_sqrt_hz * sqrt(window_s)
        bias_rad = fabs(sheet.rate_bias_rad_s) * window_s
        error_rad = 2.0 * sheet.step_rad + noise_rad + bias_rad
        self._turn_rad = STUCK_RAD + error_rad if sheet.own_rate else inf
        self._exact = sheet.step_rad == 0.0
        self._witness_change = sheet.witness_change
        self._next_tick: int | None = None
        self._ticks = 0
        self._stuck = False
        self._turned_rad = self._least = self._most = 0.0

    def stuck(self, tick: int, rate_rad_s: float, witness: float) -> bool:
        """Hear the witnesses of a tick with the same angle as in the one before.

        Once it is stuck it stays so until the angle changes.
        """
        if tick != self._next_tick:
            self._stuck = False
        if tick != self._next_tick or self._ticks == WINDOW_TICKS:
            self._ticks, self._turned_rad = 0, 0.0
            self._least = self._most = witness
        self._next_tick = tick + 1
        self._ticks += 1
        self._turned_rad += rate_rad_s * self._tick_s
        self._least, self._most = min(self._least, witness), max(self._most, witness)
        moved = self._exact and self._most - self._least > self._witness_change
        turned = fabs(self._turned_rad) > self._turn_rad
        self._stuck |= turned or (moved and self._ticks >= STUCK_TICKS)
        return self._stuck


def _slack_rad(sheet: AngleSheet, tick_s: float) -> float:
    """How far an angle and a rate by this sheet can be off each other, but for steps."""
    deviation_rad = sheet.noise_rad_per_sqrt_hz / sqrt(tick_s)
    # White noise of the rate, summed up while it fades, as if it were there for half that time.
    deviation_rad += sheet.rate_noise_rad_s_per_sqrt_hz * sqrt(0.5 * FADES_S)
    slack_rad = OFF_RAD + OFF_RAD_S * tick_s + NOISE_DEVIATIONS * deviation_rad
    slack_rad += fabs(sheet.rate_bias_rad_s) * FADES_S
    if sheet.uneven:
        slack_rad += 2.0 * UNEVEN_RAD_S * tick_s
    return slack_rad
