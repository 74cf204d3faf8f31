"""Sensors of a board: what they are called, what their data sheet says, and what can go wrong.

Rule: plant and board read the same data sheet. The plant makes its readings by it; the board knows
from it what its sensors cannot say: steps it has to expect, and noise it must not take for motion.
"""

from typing import NamedTuple

ENCODER, GYROSCOPE, TORQUE, IMU, FOOT, ALL = "encoder", "gyroscope", "torque", "imu", "foot", "all"
FIELDS: dict[str, tuple[int, ...]] = {
    ENCODER: (0,),
    GYROSCOPE: (1,),
    TORQUE: (2,),
    IMU: (3, 4),
    FOOT: (5, 6),
}
"""Which of an observation's seven readings a sensor makes, `joint_rad` being 0."""
NAMES = (*FIELDS, ALL)
"""What a fault may be given to."""

OK, OFF, STUCK, GARBAGE, SLOW, DELAYED, INTERMITTENT = (
    "ok",
    "off",
    "stuck",
    "garbage",
    "slow",
    "delayed",
    "intermittent",
)
FAULTS = (OK, OFF, STUCK, GARBAGE, SLOW, DELAYED, INTERMITTENT)
"""What a sensor shows: the truth; no number; its last value for ever; any value at all; a new value
only every n ticks; values of n ticks ago; no number with a probability in each tick."""
AMOUNT_TICKS = frozenset({SLOW, DELAYED})
AMOUNT_TICKS_MAX = 10_000


class SensorSheet(NamedTuple):
    """How good a board's sensors are. All zero: exact."""

    encoder_step_rad: float = 0.0
    encoder_offset_rad: float = 0.0
    differentiates: bool = False
    """The joint rate is the encoder's difference over a tick; else a gyroscope measures it."""
    joint_rate_filter_s: float = 0.0
    """Time constant of the low-pass behind the difference."""
    joint_rate_noise_rad_s_per_sqrt_hz: float = 0.0
    imu_noise_rad_per_sqrt_hz: float = 0.0
    imu_rate_noise_rad_s_per_sqrt_hz: float = 0.0
    imu_bias_rad: float = 0.0
    imu_rate_bias_rad_s: float = 0.0


EXACT = SensorSheet()


def sensors_of(*, imu: bool, force_plate: bool, differentiates: bool) -> tuple[str, ...]:
    """Names of the sensors of a board with this equipment."""
    has = {
        ENCODER: True,
        GYROSCOPE: not differentiates,
        TORQUE: True,
        IMU: imu,
        FOOT: force_plate,
    }
    return tuple(name for name, there in has.items() if there)


def amount_trouble(fault: str, amount: float) -> str | None:
    """Why a fault cannot be of this size; None if it can. NaN cannot."""
    if fault in AMOUNT_TICKS:
        if not 1 <= amount <= AMOUNT_TICKS_MAX or amount != int(amount):
            return f"{fault} takes 1 to {AMOUNT_TICKS_MAX} whole ticks, not {amount:g}"
    elif fault == INTERMITTENT:
        if not 0 <= amount <= 1:
            return f"{fault} takes a probability, not {amount:g}"
    elif amount != 0:
        return f"{fault} takes no amount"
    return None
