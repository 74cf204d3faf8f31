"""Sensors: what one board can see of the body, and nothing else.

    the body -> its board's clock -> steps, bias, noise -> faults -> rate by difference -> the board

Rule 1: an exact sensor costs nothing: a board that has no others, and no fault, gets the body's own
        numbers.
Rule 2: all chance is drawn from seed, board and tick, here, before the readings are sent. So they
        are the same in processes and in the twin, and nobody has to record them.
Rule 3: readings are taken once in a tick, in realtime once in each of a board's periods: some
        sensors remember the last one.
"""

from collections.abc import Sequence
from math import exp, floor, isfinite, sqrt
from typing import Final

from plant_server.body.body import Body
from plant_server.hardware.sensor_faults import SensorFaults
from protocol.robot.chance import Chance
from protocol.robot.clocks import Clock
from protocol.robot.events import SensorFault
from protocol.robot.hardware import STEADY, ClockSheet
from protocol.robot.sensors import (
    EXACT,
    SENSORS,
    FaultKind,
    Readings,
    SensorName,
    SensorSheet,
    noises,
)

IMU: Final[SensorName] = "imu"
FOOT: Final[SensorName] = "foot"


def truth(body: Body, board: int, has: frozenset[SensorName]) -> Readings:
    """Read the joint of a board, and IMU and force plate if it has them; 0 if it has not."""
    imu_rad = imu_rad_s = foot_force_n = foot_cop_m = 0.0
    if IMU in has:
        imu_rad = body.orientations_rad()[board]
        imu_rad_s = body.orientation_rates_rad_s()[board]
    if FOOT in has:
        foot_force_n, foot_cop_m = body.foot_force_n, body.foot_cop_m
    # By place: by name costs as much again, for every board in every tick. A test compares each.
    return Readings(
        body.angles_rad[board],
        body.rates_rad_s[board],
        body.torques_nm[board],
        imu_rad,
        imu_rad_s,
        foot_force_n,
        foot_cop_m,
    )


class Differentiator:
    """A rate from an angle: its difference over the time since the last one, then a low-pass.

    The low-pass is a first-order lag, exact for an input that stays the same between two ticks.
    """

    def __init__(self, *, tick_s: float, filter_s: float) -> None:
        self._tick_s = tick_s
        self._filter_s = filter_s
        self._last: tuple[int, float] | None = None
        self._rate_rad_s = 0.0

    def rate_rad_s(self, tick: int, rad: float) -> float:
        """The rate at a tick. Of what is no number: no number, and nothing remembered."""
        if not isfinite(rad):
            return rad
        if self._last is not None:
            last_tick, last_rad = self._last
            elapsed_s = (tick - last_tick) * self._tick_s
            raw_rad_s = (rad - last_rad) / elapsed_s
            share = 1.0 - exp(-elapsed_s / self._filter_s) if self._filter_s else 1.0
            self._rate_rad_s += share * (raw_rad_s - self._rate_rad_s)
        self._last = tick, rad
        return self._rate_rad_s

    def restart(self) -> None:
        """Forget: another board has come."""
        self._last, self._rate_rad_s = None, 0.0


class Instruments:
    """The sensors of a board as its data sheet has them, read when its clock says so."""

    def __init__(
        self,
        sheet: SensorSheet,
        clock: Clock,
        chance: Chance,
        *,
        tick_s: float,
        every_ticks: int = 1,
    ) -> None:
        self.sheet = sheet
        self._clock = clock
        self._chance = chance
        self._tick_s = tick_s
        # A noise density times this is the deviation of one reading.
        per_reading = 1.0 / sqrt(tick_s * every_ticks)
        self._noises = {
            field: (density * per_reading, purpose) for field, density, purpose in noises(sheet)
        }
        """Deviation of a reading, and what its noise is drawn for."""
        self.differentiator = (
            Differentiator(tick_s=tick_s, filter_s=sheet.joint_rate_filter_s)
            if sheet.differentiates
            else None
        )

    def measure(self, tick: int, truth: Readings, *, imu: bool) -> Readings:
        """What the sensors say of the truth, rates by difference left out."""
        sheet = self.sheet
        age_s = self._clock.age_ticks(tick) * self._tick_s
        joint_rad = truth.joint_rad - age_s * truth.joint_rad_s + sheet.encoder_offset_rad
        step = sheet.encoder_step_rad
        if step and isfinite(joint_rad):
            joint_rad = step * floor(joint_rad / step + 0.5)
        taken = truth._replace(
            joint_rad=joint_rad, joint_rad_s=truth.joint_rad_s + self._noise(tick, "joint_rad_s")
        )
        if not imu:
            return taken
        imu_rad = truth.imu_rad - age_s * truth.imu_rad_s
        return taken._replace(
            imu_rad=imu_rad + sheet.imu_bias_rad + self._noise(tick, "imu_rad"),
            imu_rad_s=truth.imu_rad_s + sheet.imu_rate_bias_rad_s + self._noise(tick, "imu_rad_s"),
        )

    def _noise(self, tick: int, field: str) -> float:
        """What noise adds to a reading; 0.0 if its data sheet has none."""
        if field not in self._noises:
            return 0.0
        deviation, purpose = self._noises[field]
        return deviation * self._chance.normal(tick, purpose)


class Sensors:
    """The sensors of the whole body, each read by its board alone."""

    def __init__(
        self,
        names: Sequence[tuple[SensorName, ...]],
        sheets: Sequence[SensorSheet],
        clock_sheets: Sequence[ClockSheet],
        *,
        ticks_per_period: Sequence[int],
        seed: int,
        tick_s: float,
    ) -> None:
        """Of each board: sensors, their data sheet, its clock's, how often it reads them.

        No sheets: all of them are exact.
        """
        self._has = [frozenset(of) for of in names]
        self._ticks_per_period = ticks_per_period
        self._seed = seed
        self._instruments: dict[int, Instruments] = {}
        self._faults: dict[int, SensorFaults] = {}
        for board, (sheet, clock_sheet) in enumerate(zip(sheets, clock_sheets, strict=True)):
            if sheet == EXACT and clock_sheet == STEADY:
                continue
            self._instruments[board] = Instruments(
                sheet,
                Clock(clock_sheet, seed=seed, board=board, tick_s=tick_s),
                Chance(seed=seed, board=board),
                tick_s=tick_s,
                every_ticks=ticks_per_period[board],
            )
        self._special = set(self._instruments)
        """Boards that do not simply get the truth."""

    def read(self, body: Body, board: int, tick: int) -> Readings:
        """What a board senses in a tick."""
        has = self._has[board]
        taken = truth(body, board, has)
        if board not in self._special:
            return taken
        instruments = self._instruments.get(board)
        if instruments is not None:
            taken = instruments.measure(tick, taken, imu=IMU in has)
        if board in self._faults:
            taken = self._faults[board].apply(tick, taken)
        if instruments is not None and instruments.differentiator is not None:
            rate_rad_s = instruments.differentiator.rate_rad_s(tick, taken.joint_rad)
            taken = taken._replace(joint_rad_s=rate_rad_s)
        return taken

    def restart(self, board: int) -> None:
        """A joint has another board: what its sensors remember is of the one before."""
        instruments = self._instruments.get(board)
        if instruments is not None and instruments.differentiator is not None:
            instruments.differentiator.restart()

    def obey(self, tick: int, command: SensorFault) -> None:
        """Let a sensor fail, or be whole again. The fault is the joint's: it outlives its board."""
        board = command.board
        if board not in self._faults:
            chance = Chance(seed=self._seed, board=board)
            self._faults[board] = SensorFaults(
                [name for name in SENSORS if name in self._has[board]],
                chance,
                every_ticks=self._ticks_per_period[board],
            )
            self._special.add(board)
        self._faults[board].obey(tick, command)

    def faults(self, board: int, tick: int) -> dict[SensorName, FaultKind]:
        """Which sensors of a board are faulty in a tick, and how."""
        return self._faults[board].active(tick) if board in self._faults else {}
