"""Sensor faults: what a broken sensor shows in place of its reading.

Rule 1: a fault starts in the tick of its command, and ends by itself or by another command. It sits
        where the sensor is read, so boards cannot tell it from the truth but by what it says.
Rule 2: chance is drawn from seed, board and tick. A run with faults can be played again.

The kinds are those that PX4 injects into an autopilot's sensors. What a sensor has shown before the
fault is not kept: a delayed sensor stands still until its delay has passed, then runs behind.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from protocol.robot import sensors
from protocol.robot.chance import GARBAGE, INTERMITTENT, Chance

NO_NUMBER = float("nan")
RANGES = (3.2, 35.0, 1000.0, 3.2, 35.0, 2000.0, 0.3)
"""The largest that each reading can be when it is garbage: half a turn, what a gyroscope has for
its full scale (2000 degrees a second), and torque, force and pressure of some large foot."""

Values = tuple[float, ...]


class Fault(NamedTuple):
    """What is wrong with a sensor, since when, and until which tick (None: for good)."""

    kind: str
    amount: float
    since_tick: int
    until_tick: int | None
    memory: deque[Values]
    """What the sensor has shown before, as far as the kind needs it."""


class SensorFaults:
    """Faults of the sensors of one board, which `has` them by these names, read `every_ticks`."""

    def __init__(self, has: Sequence[str], chance: Chance, *, every_ticks: int = 1) -> None:
        self._has = has
        self._chance = chance
        self._every_ticks = every_ticks
        self._faults: dict[str, Fault] = {}

    def obey(self, tick: int, sensor: str, kind: str, amount: float, ticks: int) -> None:
        """Let a sensor be faulty from a tick on, for some ticks or (0) until told otherwise."""
        for name in self._has if sensor == sensors.ALL else [sensor]:
            self._faults.pop(name, None)
            if kind != sensors.OK:
                kept = self._readings_in(amount) + 1 if kind == sensors.DELAYED else 1
                until_tick = tick + ticks if ticks else None
                self._faults[name] = Fault(kind, amount, tick, until_tick, deque(maxlen=kept))

    def told(self, tick: int) -> dict[str, str]:
        """Which sensors are faulty in a tick, and how."""
        self._expire(tick)
        return {name: fault.kind for name, fault in self._faults.items()}

    def spoil(self, tick: int, readings: Values) -> Values:
        """What the board gets in place of its readings; call it once in each tick."""
        self._expire(tick)
        shown = list(readings)
        for name, fault in self._faults.items():
            fields = sensors.FIELDS[name]
            now = tuple(readings[field] for field in fields)
            for field, value in zip(fields, self._shown(tick, fault, fields, now), strict=True):
                shown[field] = value
        return tuple(shown)

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

    def _shown(self, tick: int, fault: Fault, fields: tuple[int, ...], now: Values) -> Values:
        nothing = (NO_NUMBER,) * len(now)
        memory = fault.memory
        match fault.kind:
            case sensors.OFF:
                return nothing
            case sensors.GARBAGE:
                return tuple(map(self._garbage, fields, (tick,) * len(fields)))
            case sensors.INTERMITTENT:
                gone = self._chance.uniform(tick, INTERMITTENT) < fault.amount
                return nothing if gone else now
            case sensors.SLOW:
                readings = (tick - fault.since_tick) // self._every_ticks
                fresh = readings % self._readings_in(fault.amount) == 0
            case sensors.STUCK:
                fresh = False
            case _:
                fresh = True
        if fresh or not memory:
            memory.append(now)
        return memory[0]

    def _garbage(self, field: int, tick: int) -> float:
        return (2.0 * self._chance.uniform(tick, GARBAGE + field) - 1.0) * RANGES[field]
