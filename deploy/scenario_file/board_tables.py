"""Tables of a board's hardware: its clock, sensors, actuator, and what the joint itself does.

    [board.clock]      [board.sensors]      [board.actuator]      [board.passive]      [board.foot]

Everything is ideal unless a table says otherwise. What a file may say is here, what it becomes in a
resolved scenario is beside it; what values mean together is in `hardware_misfits`.
"""

from collections.abc import Iterator
from math import pi, radians
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from deploy.scenario_file.event_tables import BodyNames
from deploy.scenario_file.ticks import whole_ticks
from protocol.robot.hardware import ClockSheet, FootSheet, MotorSheet, PassiveElement
from protocol.robot.sensors import SensorName, SensorSheet, sensors_of

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Degrees = Annotated[float, Field(ge=-180, le=180)]
DegreesPerSecond = Annotated[float, Field(ge=-2000, le=2000)]
Milliseconds = Annotated[float, Field(ge=0, le=100_000)]
Time = Annotated[float, Field(ge=0, le=100_000)]
OVERRUNS_MAX = 10_000


class HardwareTable(BaseModel):
    """A table below `[board]`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class ClockTable(HardwareTable):
    """A board's clock and loop, which are not the plant's."""

    skew_ppm: Annotated[float, Field(ge=-10_000, le=10_000)] = 0.0
    """How much faster than the plant's clock it runs."""
    jitter_ms: Milliseconds = 0.0
    """The loop starts up to so much early, uniformly distributed; less than a tick."""
    start_up_ms: Milliseconds = 0.0
    """From plugged in to ready; whole ticks."""
    start_up_jitter_ms: Milliseconds = 0.0
    """Up to so much more, uniformly distributed; whole ticks."""
    overrun_at_s: Annotated[list[Time], Field(max_length=OVERRUNS_MAX)] = []
    """Times of ticks that the loop does not finish in time."""


class SensorTable(HardwareTable):
    """Errors of a board's sensors."""

    encoder_bits: Annotated[int, Field(ge=0, le=32)] = 0
    """Steps per turn, as a power of two; 0: exact."""
    encoder_offset_deg: Degrees = 0.0
    """The encoder reads so much too high."""
    joint_rate: Literal["gyroscope", "encoder"] = "gyroscope"
    """Measured by a sensor of its own, or the difference of two encoder readings."""
    joint_rate_filter_ms: Milliseconds = 0.0
    """Time constant of a first-order low-pass behind that difference."""
    joint_rate_noise_deg_s_per_sqrt_hz: NotNegative = 0.0
    """Noise density of the gyroscope."""
    imu_noise_deg_per_sqrt_hz: NotNegative = 0.0
    """Noise density of the orientation."""
    imu_rate_noise_deg_s_per_sqrt_hz: NotNegative = 0.0
    """Noise density of its rate."""
    imu_bias_deg: Degrees = 0.0
    """Constant error of the orientation."""
    imu_rate_bias_deg_s: DegreesPerSecond = 0.0
    """Constant error of its rate."""


class ActuatorTable(HardwareTable):
    """Limits of a board's motor, besides the torque limit of its servo."""

    torque_rate_nm_s: Positive | None = None
    """How fast the torque can change; the servo knows it. None: at once."""
    torque_step_nm: NotNegative = 0.0
    """The command is rounded to a whole number of such steps; 0: it is not."""
    lag_ms: Milliseconds = 0.0
    """Time constant of a first-order lag from command to torque."""
    hold_ticks: Annotated[int, Field(ge=0, le=1000)] = 10
    """How long the last valid command replaces one that is not finite; then 0 N m."""


class PassiveTable(HardwareTable):
    """The joint's own spring and damper, beside the motor (the paper's table I: 0)."""

    stiffness_nm_rad: NotNegative = 0.0
    """Of the spring."""
    damping_nm_s_rad: NotNegative = 0.0
    """Of the damper."""
    rest_deg: Degrees = 0.0
    """Joint angle at which the spring is at rest."""


class FootTable(HardwareTable):
    """The sole, from the ankle."""

    ahead_m: Positive
    """From the ankle to the toes."""
    behind_m: Positive
    """From the ankle to the heel."""


class BoardHardware(BaseModel):
    """What a board has, as a part of `[[board]]`."""

    imu: bool = False
    """Measures the link's orientation in space; the top board must have one."""
    force_plate: bool = False
    """Measures force and centre of pressure below the foot."""
    clock: ClockTable = ClockTable()
    sensors: SensorTable = SensorTable()
    actuator: ActuatorTable = ActuatorTable()
    passive: PassiveTable = PassiveTable()
    foot: FootTable | None = None


def clock_sheet(clock: ClockTable, tick_ms: float) -> ClockSheet:
    """A clock in seconds and ticks."""
    overruns = {whole_ticks(at_s * 1e3, tick_ms) or 0 for at_s in clock.overrun_at_s}
    return ClockSheet(
        skew_ppm=clock.skew_ppm,
        jitter_s=clock.jitter_ms / 1e3,
        start_up_ticks=whole_ticks(clock.start_up_ms, tick_ms) or 0,
        start_up_jitter_ticks=whole_ticks(clock.start_up_jitter_ms, tick_ms) or 0,
        overrun_ticks=tuple(sorted(overruns)),
    )


def sensor_sheet(sensors: SensorTable) -> SensorSheet:
    """Sensors in SI units."""
    return SensorSheet(
        encoder_step_rad=2.0 * pi / 2**sensors.encoder_bits if sensors.encoder_bits else 0.0,
        encoder_offset_rad=radians(sensors.encoder_offset_deg),
        differentiates=sensors.joint_rate == "encoder",
        joint_rate_filter_s=sensors.joint_rate_filter_ms / 1e3,
        joint_rate_noise_rad_s_per_sqrt_hz=radians(sensors.joint_rate_noise_deg_s_per_sqrt_hz),
        imu_noise_rad_per_sqrt_hz=radians(sensors.imu_noise_deg_per_sqrt_hz),
        imu_rate_noise_rad_s_per_sqrt_hz=radians(sensors.imu_rate_noise_deg_s_per_sqrt_hz),
        imu_bias_rad=radians(sensors.imu_bias_deg),
        imu_rate_bias_rad_s=radians(sensors.imu_rate_bias_deg_s),
    )


def motor_sheet(actuator: ActuatorTable) -> MotorSheet:
    """A motor in SI units."""
    return MotorSheet(
        torque_rate_nm_s=actuator.torque_rate_nm_s,
        torque_step_nm=actuator.torque_step_nm,
        lag_s=actuator.lag_ms / 1e3,
        hold_ticks=actuator.hold_ticks,
    )


def passive_element(passive: PassiveTable) -> PassiveElement:
    """Spring and damper in SI units."""
    return PassiveElement(
        rest_rad=radians(passive.rest_deg),
        stiffness_nm_rad=passive.stiffness_nm_rad,
        damping_nm_s_rad=passive.damping_nm_s_rad,
    )


def foot_sheet(foot: FootTable | None) -> FootSheet | None:
    """The sole of a board that stands on the ground."""
    return None if foot is None else FootSheet(foot.ahead_m, foot.behind_m)


def sensor_names(board: BoardHardware) -> tuple[SensorName, ...]:
    """Names of the sensors that a board has."""
    return sensors_of(sensor_sheet(board.sensors), imu=board.imu, force_plate=board.force_plate)


def hardware_misfits(i: int, board: BoardHardware, body: BodyNames) -> Iterator[str]:
    """What is wrong between the values of board i's hardware, each as `path: reason`."""
    path = f"board.{i}"
    yield from _clock_misfits(f"{path}.clock", board.clock, body)
    sensors = board.sensors
    for key in sorted(sensors.model_fields_set):
        if key.startswith("imu_") and getattr(sensors, key) and not board.imu:
            yield f"{path}.sensors.{key}: this board has no IMU; say imu = true"
    if sensors.joint_rate == "encoder" and sensors.joint_rate_noise_deg_s_per_sqrt_hz:
        yield (
            f"{path}.sensors.joint_rate_noise_deg_s_per_sqrt_hz: is a gyroscope's, but joint_rate"
            " is taken from the encoder"
        )
    if sensors.joint_rate == "gyroscope" and sensors.joint_rate_filter_ms:
        yield (
            f"{path}.sensors.joint_rate_filter_ms: filters the encoder's difference, but joint_rate"
            " is measured by a gyroscope"
        )
    if board.foot is not None and i > 0:
        yield f"{path}.foot: only the lowest board, board.0, stands on the ground"


def _clock_misfits(path: str, clock: ClockTable, body: BodyNames) -> Iterator[str]:
    overruns = enumerate(clock.overrun_at_s)
    times_ms = {
        "start_up_ms": clock.start_up_ms,
        "start_up_jitter_ms": clock.start_up_jitter_ms,
        **{f"overrun_at_s.{n}": at_s * 1e3 for n, at_s in overruns},
    }
    for key, value_ms in times_ms.items():
        if whole_ticks(value_ms, body.tick_ms) is None:
            yield f"{path}.{key}: not a whole number of ticks of {body.tick_ms:g} ms"
    if clock.jitter_ms >= body.tick_ms:
        yield f"{path}.jitter_ms: {clock.jitter_ms:g} ms is not below a tick of {body.tick_ms:g} ms"


def realtime_clock_misfits(path: str, clock: ClockTable) -> Iterator[str]:
    """What of a clock means nothing in realtime, each as `path: reason`."""
    real = "a loop in realtime has jitter and overruns of its own, and counts them; leave it out"
    if clock.jitter_ms:
        yield f"{path}.jitter_ms: {real}"
    if clock.overrun_at_s:
        yield f"{path}.overrun_at_s: {real}"
