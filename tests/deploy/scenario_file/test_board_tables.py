"""Hardware of boards in a scenario: what it becomes, and what is wrong with it."""

from math import pi, radians

import pytest

from deploy.scenario_file.load import load
from module_agent.firmware.config import board_config
from plant_server.session.config import plant_config
from protocol.robot.events import SensorFault
from protocol.robot.hardware import IDEAL, STEADY, FootSheet
from protocol.robot.scenario import BoardSettings, ScenarioError, ScenarioEvent
from protocol.robot.sensors import EXACT

KNEE, HIP = 1, 2


def board(index: int, *settings: str) -> BoardSettings:
    return load("paper", list(settings)).boards[index]


def complaints(*settings: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load("paper", list(settings))
    return [line.partition("paper.toml: ")[2] for line in str(caught.value).splitlines()]


def test_everything_is_ideal_unless_a_table_says_otherwise() -> None:
    scenario = load("paper")
    plant = plant_config(scenario)
    assert set(plant.sensor_sheets) == {EXACT}
    assert set(plant.clock_sheets) == {STEADY}
    assert set(plant.motor_sheets) == {IDEAL}
    assert set(plant.passive) == {None}
    assert plant.foot is None
    for joint in plant.joints:
        firmware = board_config(scenario, joint)
        assert (firmware.clock, firmware.sensor_sheet) == (STEADY, EXACT)
        assert firmware.torque_rate_nm_s is None


@pytest.mark.parametrize(
    ("setting", "table", "key", "value"),
    [
        ("clock.skew_ppm=-50", "clock", "skew_ppm", -50.0),
        ("clock.jitter_ms=0.5", "clock", "jitter_s", 5e-4),
        ("clock.start_up_ms=120", "clock", "start_up_ticks", 120),
        ("clock.start_up_jitter_ms=30", "clock", "start_up_jitter_ticks", 30),
        ("clock.overrun_at_s=[0.5, 0.1, 0.5]", "clock", "overrun_ticks", (100, 500)),
        ("sensors.encoder_bits=12", "sensors", "encoder_step_rad", 2.0 * pi / 4096),
        ("sensors.encoder_bits=0", "sensors", "encoder_step_rad", 0.0),
        ("sensors.encoder_offset_deg=2", "sensors", "encoder_offset_rad", radians(2.0)),
        ("sensors.joint_rate=encoder", "sensors", "differentiates", True),
        (
            "sensors.joint_rate_noise_deg_s_per_sqrt_hz=0.1",
            "sensors",
            "joint_rate_noise_rad_s_per_sqrt_hz",
            radians(0.1),
        ),
        ("actuator.torque_rate_nm_s=2000", "actuator", "torque_rate_nm_s", 2000.0),
        ("actuator.torque_step_nm=0.1", "actuator", "torque_step_nm", 0.1),
        ("actuator.lag_ms=2", "actuator", "lag_s", 2e-3),
        ("passive.stiffness_nm_rad=100", "passive", "stiffness_nm_rad", 100.0),
        ("passive.damping_nm_s_rad=10", "passive", "damping_nm_s_rad", 10.0),
        ("passive.rest_deg=5", "passive", "rest_rad", radians(5.0)),
    ],
)
def test_resolved_values_are_in_si_and_whole_ticks(
    setting: str, table: str, key: str, value: object
) -> None:
    knee, hip = load("paper", [f"board.1.{setting}"]).boards[1:]
    assert getattr(getattr(knee, table), key) == value
    assert getattr(hip, table) == getattr(board(HIP), table), "of that board alone"


@pytest.mark.parametrize(
    ("key", "resolved"),
    [
        ("imu_noise_deg_per_sqrt_hz", "imu_noise_rad_per_sqrt_hz"),
        ("imu_rate_noise_deg_s_per_sqrt_hz", "imu_rate_noise_rad_s_per_sqrt_hz"),
        ("imu_bias_deg", "imu_bias_rad"),
        ("imu_rate_bias_deg_s", "imu_rate_bias_rad_s"),
    ],
)
def test_an_imu_has_noise_and_bias_if_there_is_one(key: str, resolved: str) -> None:
    sensors = board(HIP, f"board.2.sensors.{key}=0.5").sensors
    assert getattr(sensors, resolved) == radians(0.5)
    (complaint,) = complaints(f"board.1.sensors.{key}=0.5")
    assert complaint == f"board.1.sensors.{key}: this board has no IMU; say imu = true"


def test_the_foot_is_the_ankles() -> None:
    sole = ("foot.ahead_m=0.2", "foot.behind_m=0.06")
    found = load("paper", [f"board.0.{key}" for key in sole])
    assert found.boards[0].foot == FootSheet(ahead_m=0.2, behind_m=0.06)
    assert plant_config(found).foot == found.boards[0].foot
    (complaint,) = complaints(*(f"board.1.{key}" for key in sole))
    assert complaint.startswith("board.1.foot: only the lowest board, board.0, stands on")


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("clock.skew_ppm=1e6", "clock.skew_ppm: input should be less than or equal to 10000"),
        ("clock.jitter_ms=1.0", "clock.jitter_ms: 1 ms is not below a tick of 1 ms"),
        ("clock.start_up_ms=0.5", "clock.start_up_ms: not a whole number of ticks of 1 ms"),
        (
            "clock.overrun_at_s=[0.1, 0.0005]",
            "clock.overrun_at_s.1: not a whole number of ticks of 1 ms",
        ),
        ("clock.overrun_at_s=[-1]", "clock.overrun_at_s.0: input should be greater than or equal"),
        ("clock.skew=1", "clock.skew: unknown key; did you mean 'skew_ppm'?"),
        ("sensors.encoder_bits=33", "sensors.encoder_bits: input should be less than or equal"),
        ("sensors.encoder_bits=1.5", "sensors.encoder_bits: input should be a valid integer"),
        ("sensors.joint_rate=wheel", "sensors.joint_rate: input should be 'gyroscope' or 'enc"),
        (
            "sensors.joint_rate_filter_ms=5",
            "sensors.joint_rate_filter_ms: filters the encoder's difference, but joint_rate is",
        ),
        ("sensors.encoder_offset_deg=nan", "sensors.encoder_offset_deg: input should be"),
        ("actuator.lag_ms=-1", "actuator.lag_ms: input should be greater than or equal to 0"),
        ("actuator.torque_rate_nm_s=0", "actuator.torque_rate_nm_s: input should be greater than"),
        ("passive.stiffness_nm_rad=-1", "passive.stiffness_nm_rad: input should be greater than"),
        ("passive.stifness_nm_rad=1", "passive.stifness_nm_rad: unknown key; did you mean"),
        ("foot.ahead_m=0.2", "foot.behind_m: field required"),
    ],
)
def test_a_mistake_names_its_key_and_its_reason(setting: str, complaint: str) -> None:
    (found,) = complaints(f"board.0.{setting}")
    assert found.startswith(f"board.0.{complaint}")


def test_all_mistakes_between_values_come_at_once() -> None:
    found = complaints(
        "board.0.clock.jitter_ms=2",
        "board.1.sensors.imu_bias_deg=1",
        "board.1.sensors.joint_rate=encoder",
        "board.1.sensors.joint_rate_noise_deg_s_per_sqrt_hz=1",
        "board.2.actuator.lag_ms=-1",
    )
    assert sorted(line.split(": ")[0] for line in found) == [
        "board.0.clock.jitter_ms",
        "board.1.sensors.imu_bias_deg",
        "board.1.sensors.joint_rate_noise_deg_s_per_sqrt_hz",
        "board.2.actuator.lag_ms",
    ]


def event(**values: object) -> str:
    told = {"at_s": 1.0, "do": "sensor", "joint": "knee", "fault": "stuck"} | values
    return f"event=[{{{', '.join(f'{key}={value!r}' for key, value in told.items())}}}]"


@pytest.mark.parametrize(
    ("values", "command"),
    [
        ({}, SensorFault(KNEE, "encoder", "stuck", 0.0, 0)),
        ({"duration_s": 0.5}, SensorFault(KNEE, "encoder", "stuck", 0.0, 500)),
        ({"sensor": "all", "fault": "ok"}, SensorFault(KNEE, "all", "ok", 0.0, 0)),
        ({"fault": "slow"}, SensorFault(KNEE, "encoder", "slow", 20.0, 0)),
        ({"fault": "slow", "period_ms": 5}, SensorFault(KNEE, "encoder", "slow", 5.0, 0)),
        ({"fault": "delayed"}, SensorFault(KNEE, "encoder", "delayed", 100.0, 0)),
        ({"fault": "delayed", "delay_ms": 30.0}, SensorFault(KNEE, "encoder", "delayed", 30.0, 0)),
        ({"fault": "intermittent"}, SensorFault(KNEE, "encoder", "intermittent", 0.5, 0)),
        (
            {"joint": "hip", "sensor": "imu", "fault": "intermittent", "probability": 0.1},
            SensorFault(HIP, "imu", "intermittent", 0.1, 0),
        ),
    ],
)
def test_a_sensor_fails_on_schedule(values: dict[str, object], command: SensorFault) -> None:
    assert load("paper", [event(**values)]).events == (ScenarioEvent(1000, command),)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"joint": "elbow"}, "event.0.joint: there is no 'elbow'"),
        ({"sensor": "imu"}, "event.0.sensor: knee has no imu"),
        ({"sensor": "foot"}, "event.0.sensor: knee has no foot"),
        ({"sensor": "nose"}, "event.0.sensor.sensor: input should be 'encoder', 'gyroscope'"),
        ({"fault": "drunk"}, "event.0.sensor.fault: input should be 'ok', 'off', 'stuck'"),
        ({"delay_ms": 5}, "event.0.delay_ms: a sensor that is stuck has none"),
        ({"fault": "slow", "delay_ms": 5}, "event.0.delay_ms: a sensor that is slow has none"),
        ({"fault": "slow", "period_ms": 0.5}, "event.0.period_ms: not a whole number of ticks"),
        ({"fault": "slow", "period_ms": 0}, "event.0.period_ms: slow takes 1 to 10000 whole"),
        (
            {"fault": "delayed", "delay_ms": 50_000},
            "event.0.delay_ms: delayed takes 1 to 10000 whole",
        ),
        (
            {"fault": "intermittent", "probability": 2},
            "event.0.sensor.probability: input should be less",
        ),
        ({"at_s": 10.0}, "event.0.at_s: 10 s is not before the end of the run"),
        ({"duration_s": 0.0005}, "event.0.duration_s: not a whole number of ticks"),
    ],
)
def test_a_sensor_that_cannot_fail_so_is_refused(values: dict[str, object], complaint: str) -> None:
    (found,) = complaints(event(**values))
    assert found.startswith(complaint)


def test_a_gyroscope_is_there_where_the_rate_is_not_the_encoders() -> None:
    assert load("paper", [event(sensor="gyroscope")]).events
    (found,) = complaints(event(sensor="gyroscope"), "board.1.sensors.joint_rate=encoder")
    assert found == "event.0.sensor: knee has no gyroscope"
