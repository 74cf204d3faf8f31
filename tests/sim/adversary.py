"""What goes wrong, drawn tick by tick from the seed: commands, deaths, frozen boards, blindness."""

import json
from enum import Enum, auto
from math import inf, nan
from random import Random

import msgpack

from plant_server.session import control
from plant_server.session.lockstep import Lockstep
from protocol.robot import sensors
from protocol.robot.events import (
    Command,
    LinkChange,
    LinkRepair,
    Pairs,
    Plug,
    Push,
    ReferenceChange,
    SensorFault,
    Unplug,
    values_of,
)
from protocol.wire.frames import VERSION, Observation, decode, encode, seal
from protocol.wire.wiring import neighbours
from tests.sim.plans import Plan, link_changes


class Fate(Enum):
    """What becomes of a board in a tick."""

    LIVES = auto()
    DIES_BEFORE = auto()
    """It says nothing in this tick."""
    DIES_SPEAKING = auto()
    """Some link frames have left it, its torque has not."""
    DIES_AFTER = auto()
    """The plant has its answer, and still waits for others."""
    FREEZES = auto()
    """It says nothing until it wakes up; by then the plant has gone on without it."""


class Adversary:
    """Draws faults; `healed` ends them."""

    def __init__(self, plan: Plan) -> None:
        self.rates = plan.rates
        self.size = len(plan.scenario.joints)
        self.joints = plan.scenario.joints
        self.chance = Random(f"faults {plan.seed}")
        self.until = plan.faulty_ticks
        self.healed = False
        self._blind: dict[int, tuple[int, float]] = {}

    def command(self, lockstep: Lockstep) -> None:
        """Now and then, put a command on the agenda as a scenario or a terminal would."""
        chance = self.chance
        if self.healed or chance.random() >= self.rates.command:
            return
        command, undone = self._drawn()
        tick = lockstep.plant.tick
        if chance.random() < 0.5:
            request = seal(msgpack.packb((VERSION, json.dumps(values_of(command)))))
            control.answer(lockstep, self.joints, request)
            control.answer(lockstep, self.joints, seal(msgpack.packb((VERSION, control.STATUS))))
        else:
            lockstep.plant.agenda.add(min(tick + chance.randint(0, 5), self.until), command)
        if undone:
            lockstep.plant.agenda.add(min(tick + chance.randint(2, 30), self.until), undone)

    def fate(self) -> Fate:
        """What becomes of one board in this tick."""
        if self.healed:
            return Fate.LIVES
        draw = self.chance.random()
        if draw < self.rates.silence:
            return Fate.FREEZES
        if draw < self.rates.silence + self.rates.death:
            return self.chance.choice((Fate.DIES_BEFORE, Fate.DIES_SPEAKING, Fate.DIES_AFTER))
        return Fate.LIVES

    def excuses(self, senders: tuple[int, ...]) -> int | None:
        """Now and then, a neighbour whose frame the plant stops waiting for."""
        if self.healed or not senders or self.rates.blindness:
            return None
        return self.chance.choice(senders) if self.chance.random() < self.rates.silence else None

    def wakes(self) -> bool:
        """Whether a frozen board wakes up now."""
        return self.healed or self.chance.random() < self.rates.wake

    def enrols(self) -> int | None:
        """If a new board comes now: in how many ticks it has its links up."""
        if self.chance.random() < self.rates.enrol:
            return self.chance.choice((0, 0, 1, 3, 9))
        return None

    def sensed(self, board: int, payload: bytes) -> bytes:
        """The observation as a board gets it whose sensors may be broken."""
        if self.healed or not self.rates.blindness:
            return payload
        observation = decode(Observation, payload)
        until, value = self._blind.get(board, (observation.tick, 0.0))
        if until > observation.tick:
            true = observation.readings
            shown = self.chance.choice(
                (true._replace(imu_rad_s=value), true._replace(joint_rad=value))
            )
            return encode(observation._replace(readings=shown))
        if self.chance.random() < self.rates.blindness:
            ticks = self.chance.randint(1, 25)
            value = self.chance.choice((nan, inf, -inf, 1e9, -1e300))
            self._blind[board] = observation.tick + ticks, value
        return payload

    def _drawn(self) -> tuple[Command, Command | None]:
        """A command, and perhaps one that undoes it later."""
        chance, board = self.chance, self.chance.randrange(self.size)
        match chance.randrange(10):
            case 0 | 1 | 2:
                pairs = self._pairs(board)
                changes = link_changes(chance) or {"cut": 0.0}
                return LinkChange(pairs, changes), LinkRepair(pairs)
            case 3:
                return LinkRepair(self._pairs(board)), None
            case 4:
                return ReferenceChange(board, chance.uniform(-0.2, 0.2)), None
            case 5:
                return Push(board, chance.uniform(-60.0, 60.0), chance.randint(1, 20)), None
            case 6 | 7:
                return self._sensor_fault(board), SensorFault(
                    board, sensors.ALL, sensors.OK, 0.0, 0
                )
            case _:
                plug = Plug(board)
                unplug = (Unplug(board), chance.choice((plug, None)))
                return chance.choice((unplug, (plug, None)))

    def _sensor_fault(self, board: int) -> Command:
        """Of a sensor that every board has."""
        chance = self.chance
        sensor: sensors.Faultable = chance.choice(("encoder", "gyroscope", "torque", sensors.ALL))
        fault = chance.choice(sensors.FAULTS)
        amount = 0.0
        if fault in ("slow", "delayed"):
            amount = float(chance.randint(1, 30))
        elif fault == "intermittent":
            amount = chance.random()
        return SensorFault(board, sensor, fault, amount, chance.choice((0, 1, 15, 60)))

    def _pairs(self, board: int) -> Pairs:
        near = neighbours(board, self.size)
        if not near or self.chance.random() < 0.3:
            return ()
        other = self.chance.choice(near)
        there, back = (board, other), (other, board)
        return self.chance.choice(((there,), (there, back)))
