"""Sensors: what one board can see of the body, and nothing else."""

from itertools import accumulate
from typing import NamedTuple

from plant_server.body import Body
from plant_server.config import PlantConfig


class Readings(NamedTuple):
    """The sensor fields of `protocol.frames.Observation`, in its order."""

    joint_rad: float
    joint_rad_s: float
    joint_torque_nm: float
    imu_rad: float
    imu_rad_s: float
    foot_force_n: float
    foot_cop_m: float


def readings(body: Body, config: PlantConfig, board: int) -> Readings:
    """Read the joint of a board, and IMU and force plate if it has them; 0 if it has not."""
    imu_rad = imu_rad_s = foot_force_n = foot_cop_m = 0.0
    if config.imu[board]:
        imu_rad = list(accumulate(body.angles_rad))[board]
        imu_rad_s = list(accumulate(body.rates_rad_s))[board]
    if config.force_plate[board]:
        foot_force_n, foot_cop_m = body.foot_force_n, body.foot_cop_m
    return Readings(
        body.angles_rad[board],
        body.rates_rad_s[board],
        body.torques_nm[board],
        imu_rad,
        imu_rad_s,
        foot_force_n,
        foot_cop_m,
    )
