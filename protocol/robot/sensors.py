"""Sensors of a board: the one table of what they say, their data sheet, and what can go wrong.

Rule 1: what a board's sensors say in a tick is `Readings`, a part of its observation. All that is
        known of a reading stands beside it: meaning, unit, sensor, full scale, noise.
Rule 2: plant and board read the same data sheet. The plant makes its readings by it; the board
        knows from it what its sensors cannot say: steps it has to expect, and noise it must not
        take for motion.
Rule 3: names of sensors and of faults are closed lists. Who acts on one does so in a `match` that
        ends in `assert_never`.
"""

from typing import Annotated, Final, Literal, NamedTuple, assert_never, get_args

from msgspec import Meta, Struct

SensorName = Literal["encoder", "gyroscope", "torque", "imu", "foot"]
ALL: Final = "all"
Faultable = Literal[SensorName, "all"]
"""What a fault may be given to: a sensor, or all that the board has."""
FaultKind = Literal["ok", "off", "stuck", "garbage", "slow", "delayed", "intermittent"]
"""What a sensor shows: the truth; no number; its last value for ever; any value at all; a new value
only every n ticks; values of n ticks ago; no number with a probability in each tick."""

OK: Final = "ok"

SENSORS: tuple[SensorName, ...] = get_args(SensorName)
FAULTABLE: tuple[Faultable, ...] = get_args(Faultable)
FAULTS: tuple[FaultKind, ...] = get_args(FaultKind)


class Noise(NamedTuple):
    """White noise of a reading."""

    density: str
    """The field of `SensorSheet` that says how much: deviation per square root of a hertz."""
    purpose: int
    """What it is drawn for (`protocol.robot.chance`); 7 to 15 are free."""


class Reading(NamedTuple):
    """Which sensor makes a reading, and how."""

    sensor: SensorName
    full_scale: float
    """The largest that it can be when it is garbage, in its unit."""
    noise: Noise | None = None


class Readings(NamedTuple):
    """What the sensors of a board say at the start of a tick; 0 where it has no such sensor.

    A new one goes last: garbage is drawn by its place.
    """

    joint_rad: Annotated[
        float,
        Meta(
            description="joint angle: orientation of the link above minus that of the link below",
            extra={"unit": "rad"},
        ),
        Reading("encoder", full_scale=3.2),
    ]
    joint_rad_s: Annotated[
        float,
        Meta(description="its rate", extra={"unit": "rad/s"}),
        Reading("gyroscope", full_scale=35.0, noise=Noise("joint_rate_noise_rad_s_per_sqrt_hz", 3)),
    ]
    joint_torque_nm: Annotated[
        float,
        Meta(
            description="what acted on the joint during the tick before",
            extra={"unit": "N m"},
        ),
        Reading("torque", full_scale=1000.0),
    ]
    imu_rad: Annotated[
        float,
        Meta(
            description="orientation in space of the link above the joint; 0 without an IMU",
            extra={"unit": "rad"},
        ),
        Reading("imu", full_scale=3.2, noise=Noise("imu_noise_rad_per_sqrt_hz", 4)),
    ]
    imu_rad_s: Annotated[
        float,
        Meta(description="its rate; 0 without an IMU", extra={"unit": "rad/s"}),
        Reading("imu", full_scale=35.0, noise=Noise("imu_rate_noise_rad_s_per_sqrt_hz", 5)),
    ]
    foot_force_n: Annotated[
        float,
        Meta(
            description=(
                "vertical force on the force plate, mean of the tick before; 0 without one"
            ),
            extra={"unit": "N"},
        ),
        Reading("foot", full_scale=2000.0),
    ]
    foot_cop_m: Annotated[
        float,
        Meta(
            description="centre of pressure, forward of the ankle; 0 without a force plate",
            extra={"unit": "m"},
        ),
        Reading("foot", full_scale=0.3),
    ]


_BESIDE = {field: hint.__metadata__ for field, hint in Readings.__annotations__.items()}
MEANINGS: dict[str, str] = {field: beside[0].description for field, beside in _BESIDE.items()}
UNITS: dict[str, str] = {field: beside[0].extra["unit"] for field, beside in _BESIDE.items()}
READINGS: dict[str, Reading] = {field: beside[1] for field, beside in _BESIDE.items()}
"""The table, by the name of the reading."""
PLACES: dict[SensorName, tuple[int, ...]] = {
    sensor: tuple(i for i, one in enumerate(READINGS.values()) if one.sensor == sensor)
    for sensor in SENSORS
}
"""Which of a board's readings a sensor makes, `joint_rad` being 0."""
FULL_SCALES = tuple(one.full_scale for one in READINGS.values())
"""Of each reading: half a turn, what a gyroscope has for its full scale (2000 degrees a second),
and torque, force and pressure of some large foot."""

NotNegative = Annotated[float, Meta(ge=0.0)]


class SensorSheet(Struct, frozen=True, forbid_unknown_fields=True):
    """How good a board's sensors are. All zero: exact."""

    encoder_step_rad: NotNegative = 0.0
    encoder_offset_rad: float = 0.0
    differentiates: bool = False
    """The joint rate is the encoder's difference over a tick; else a gyroscope measures it."""
    joint_rate_filter_s: NotNegative = 0.0
    """Time constant of the low-pass behind the difference."""
    joint_rate_noise_rad_s_per_sqrt_hz: NotNegative = 0.0
    imu_noise_rad_per_sqrt_hz: NotNegative = 0.0
    imu_rate_noise_rad_s_per_sqrt_hz: NotNegative = 0.0
    imu_bias_rad: float = 0.0
    imu_rate_bias_rad_s: float = 0.0


EXACT = SensorSheet()


def noises(sheet: SensorSheet) -> list[tuple[str, float, int]]:
    """Readings with noise: name, density in the reading's unit per root hertz, purpose."""
    found = []
    for field, reading in READINGS.items():
        density = 0.0 if reading.noise is None else getattr(sheet, reading.noise.density)
        if reading.noise is not None and density:
            found.append((field, density, reading.noise.purpose))
    return found


def sensors_of(sheet: SensorSheet, *, imu: bool, force_plate: bool) -> tuple[SensorName, ...]:
    """Names of the sensors of a board with this equipment."""

    def has(sensor: SensorName) -> bool:
        match sensor:
            case "encoder" | "torque":
                return True
            case "gyroscope":
                return not sheet.differentiates
            case "imu":
                return imu
            case "foot":
                return force_plate
            case _:
                assert_never(sensor)

    return tuple(sensor for sensor in SENSORS if has(sensor))


AMOUNT_TICKS_MAX = 10_000


def amount_trouble(fault: FaultKind, amount: float) -> str | None:
    """Why a fault cannot be of this size; None if it can. NaN cannot."""
    match fault:
        case "slow" | "delayed":
            if not 1 <= amount <= AMOUNT_TICKS_MAX or amount != int(amount):
                return f"{fault} takes 1 to {AMOUNT_TICKS_MAX} whole ticks, not {amount:g}"
        case "intermittent":
            if not 0 <= amount <= 1:
                return f"{fault} takes a probability, not {amount:g}"
        case "ok" | "off" | "stuck" | "garbage":
            if amount != 0:
                return f"{fault} takes no amount"
        case _:
            assert_never(fault)
    return None
