"""Sensor faults: what a broken sensor shows in place of its reading.

Rule 1: a fault starts in the tick of its command, and ends by itself or by another command. It sits
        where the sensor is read, so boards cannot tell it from the truth but by what it says.
Rule 2: chance is drawn from seed, board and tick. A run with faults can be played again.

The kinds are those that PX4 injects into an autopilot's sensors. What a sensor has shown before the
fault is not kept: a delayed sensor stands still until its delay has passed, then runs behind.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, assert_never

from protocol.robot.chance import GARBAGE, INTERMITTENT, Chance
from protocol.robot.events import SensorFault
from protocol.robot.sensors import (
    ALL,
    FULL_SCALES,
    PLACES,
    FaultKind,
    Readings,
    SensorName,
)

NO_NUMBER = float("nan")

Values = tuple[float, ...]


class ActiveFault(NamedTuple):
    """What is wrong with a sensor, since when, and until which tick (None: for good)."""

    kind: FaultKind
    amount: float
    since_tick: int
    until_tick: int | None
    memory: deque[Values]
    """What the sensor has shown before, as far as the kind needs it."""


class SensorFaults:
    """Faults of the sensors of one board, which `has` them by these names, read `every_ticks`."""

    def __init__(self, has: Sequence[SensorName], chance: Chance, *, every_ticks: int = 1) -> None:
        self._has = has
        self._chance = chance
        self._every_ticks = every_ticks
        self._faults: dict[SensorName, ActiveFault] = {}

    def obey(self, tick: int, command: SensorFault) -> None:
        """Let a sensor be faulty from a tick on, for some ticks or for good."""
        kind, amount, sensor = command.fault, command.amount, command.sensor
        for name in self._has if sensor == ALL else (sensor,):
            self._faults.pop(name, None)
            if kind != "ok":
                kept = self._readings_in(amount) + 1 if kind == "delayed" else 1
                until_tick = tick + command.ticks if command.ticks else None
                self._faults[name] = ActiveFault(kind, amount, tick, until_tick, deque(maxlen=kept))

    def active(self, tick: int) -> dict[SensorName, FaultKind]:
        """Which sensors are faulty in a tick, and how."""
        self._expire(tick)
        return {name: fault.kind for name, fault in self._faults.items()}

    def apply(self, tick: int, readings: Readings) -> Readings:
        """What the board gets in place of its readings; call it once in each tick."""
        self._expire(tick)
        shown = list(readings)
        for name, fault in self._faults.items():
            places = PLACES[name]
            now = tuple(readings[place] for place in places)
            for place, value in zip(places, self._shown(tick, fault, places, now), strict=True):
                shown[place] = value
        return Readings(*shown)

    def _readings_in(self, ticks: float) -> int:
        """How many readings so many ticks are, at least one."""
        return max(1, int(ticks) // self._every_ticks)

    def _expire(self, tick: int) -> None:
        over = [
            name
            for name, fault in self._faults.items()
            if fault.until_tick is not None and fault.until_tick <= tick
        ]
        for name in over:
            del self._faults[name]

    def _shown(self, tick: int, fault: ActiveFault, places: tuple[int, ...], now: Values) -> Values:
        match fault.kind:
            case "ok":
                return now
            case "off":
                return (NO_NUMBER,) * len(now)
            case "garbage":
                return tuple(self._garbage(tick, place) for place in places)
            case "intermittent":
                gone = self._chance.uniform(tick, INTERMITTENT) < fault.amount
                return (NO_NUMBER,) * len(now) if gone else now
            case "slow":
                readings = (tick - fault.since_tick) // self._every_ticks
                fresh = readings % self._readings_in(fault.amount) == 0
            case "stuck":
                fresh = False
            case "delayed":
                fresh = True
            case _:
                assert_never(fault.kind)
        if fresh or not fault.memory:
            fault.memory.append(now)
        return fault.memory[0]

    def _garbage(self, tick: int, place: int) -> float:
        return (2.0 * self._chance.uniform(tick, GARBAGE + place) - 1.0) * FULL_SCALES[place]
