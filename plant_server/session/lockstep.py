"""Lockstep: the body and its boards advance together, tick by tick.

    order = lockstep.begin()                a board to put in or take away before the tick
    observations = lockstep.open()          one encoded frame for each board that is there
    lockstep.answer(board, payload)         in any order, any number of times
    record = lockstep.close()               when nobody is waited for any more

Rule 1: the tick k is over when every board of the roster has answered it. Answers are a set.
Rule 2: ticks -W ... -1 are the warm-up: the normal barrier, with the body locked in its initial
        posture and torques answered but not applied, until every delay line is full. Tick 0
        releases the body (S8).
Rule 3: no clock and no I/O. Whoever drives this decides how long it waits, and starts and ends
        boards. What it decided is recorded with its tick.
Rule 4: what happens to the body happens between two ticks. A joint that loses its board or gets one
        in the middle of a tick is braked or released at its end, in whatever order that was heard.
"""

from collections import Counter
from collections.abc import Iterator
from typing import assert_never

from plant_server.body.articulated import chain_of
from plant_server.body.body import Body
from plant_server.body.disturbances import Disturbances
from plant_server.hardware.actuators import Actuators
from plant_server.hardware.sensors import Sensors
from plant_server.record import COMPLETE, FELL, Outcome, TickRecord
from plant_server.session.agenda import Agenda
from plant_server.session.answers import read_answer
from plant_server.session.attendance import Attendance
from plant_server.session.config import PlantConfig
from plant_server.session.roster import Roster
from plant_server.session.start_up import StartUp
from plant_server.session.telemetry import Failure, Telemetry
from protocol.robot.events import (
    Admission,
    BoardFault,
    Departure,
    Disturbance,
    Event,
    Excuse,
    LinkCommand,
    MidwayDeparture,
    Plug,
    Plugging,
    Ready,
    ReferenceChange,
    Scheduled,
    SensorFault,
    Sides,
    Tipping,
    Unplug,
    Why,
)
from protocol.wire.frames import Observation, ProtocolError, Reason, TorqueFrame, encode
from protocol.wire.wiring import neighbours


class Lockstep:
    """The plant of one run."""

    def __init__(self, config: PlantConfig, *, run_id: int) -> None:
        self.config = config
        self.run_id = run_id
        self.size = len(config.joints)
        self.body = Body(
            chain_of(config.links),
            initial_angles_rad=config.initial_angles_rad,
            tick_s=config.tick_s,
            substeps=config.substeps,
            fallen_below=config.fallen_below,
            passive=config.passive,
        )
        cadence = config.cadence
        self.sensors = Sensors(
            config.sensors,
            config.sensor_sheets,
            config.clock_sheets,
            ticks_per_period=cadence.ticks_per_period if cadence else (1,) * self.size,
            seed=config.seed,
            tick_s=config.tick_s,
        )
        self.actuators = Actuators(config)
        self.tick = -config.warm_up_ticks
        self.roster = Roster(self.size, config.standing_links, config.references_rad)
        self.agenda = Agenda(list(config.events))
        self.start_up = StartUp(config, self.agenda)
        self.refused: Counter[Reason] = Counter()
        self.telemetry = Telemetry(self.size)
        self.latest: list[TorqueFrame | None] = [None] * self.size
        """The last answer of each board, for whoever wants to know how it is."""
        self._events: list[Event] = []
        self._answers: list[bytes | None] = [None] * self.size
        self._attendance = Attendance(config, self.body)
        self._given: dict[int, Observation] = {}
        """What each board was told in the open tick; empty between two ticks."""
        self._left: set[int] = set()
        """Boards that are gone since the tick was opened, and did not answer it."""
        self._leaving: dict[int, Why] = {}
        """Boards that are gone since they answered the open tick, and why."""
        self._disturbances = Disturbances()
        self._sides = [list(range(self.size))]

    @property
    def over(self) -> bool:
        """The run has had its ticks, or the body lies on the ground."""
        return self.tick >= self.config.ticks or self.body.fallen

    @property
    def waiting(self) -> bool:
        """Whether a board has not answered the open tick."""
        return None in self._answers

    @property
    def waiting_for(self) -> list[int]:
        """Boards that have not answered the open tick."""
        return [i for i, answer in enumerate(self._answers) if answer is None]

    def begin(self) -> Plugging | None:
        """Look at what is due before the tick is opened.

        Returns what is for the driver to carry out, with `remove` or `admit`.
        """
        command = self.agenda.due(self.tick)
        if command is None:
            return None
        self._events.append(command)
        return self._obey(command)

    def _obey(self, command: Scheduled) -> Plugging | None:
        if isinstance(command, LinkCommand):
            self.roster.change(command)
            return None
        if isinstance(command, Disturbance):
            self._disturbances.begin(command)
            return None
        match command:
            case ReferenceChange():
                self.roster.refer(command)
            case SensorFault():
                self.sensors.obey(self.tick, command)
            case Plug():
                board = command.board
                return self.start_up.plug(board, self.tick, present=self.roster.present(board))
            case Ready():
                return Plug(command.board)
            case Unplug():
                self.start_up.unplug(command.board)
                return command
            case _:
                assert_never(command)
        return None

    def admit(self, board: int, incarnation: int) -> None:
        """Give a joint to a board, from the tick that is about to be opened."""
        self.roster.admit(board, incarnation)
        self.sensors.restart(board)
        if self.tick == -self.config.warm_up_ticks:
            self._attendance.drive(board)
        self._events.append(Admission(board, incarnation))

    def remove(self, board: int, why: Why) -> None:
        """Take a board off the roster: at once, or after the tick that it has answered (S5)."""
        if not self.roster.present(board):
            return
        if self._given and self._answers[board]:
            self._leaving.setdefault(board, why)
            return
        self.roster.remove(board)
        self._answers[board] = b""
        self.latest[board] = None
        self.telemetry.forget(board)
        self.actuators.forget(board)
        # A board that has been given its observation may have acted on it before it went.
        self._events.append(MidwayDeparture(board, why) if self._given else Departure(board, why))
        if self._given:
            self._left.add(board)
        else:
            self._leave_alone(board)

    def excuse(self, sender: int, receiver: int) -> bytes:
        """Let a board go on without a link frame in the open tick; the observation that says so.

        Should the frame come after all, it is not used, so that the verdict has one meaning (S6).
        """
        given, near = self._given[receiver], neighbours(receiver, self.size)
        if sender in near and given.neighbours[near.index(sender)].waits:
            about = list(given.neighbours)
            link = near.index(sender)
            completed_tick = min(about[link].completed_tick, self.tick - 2)
            about[link] = about[link]._replace(completed_tick=completed_tick, waits=0)
            self._given[receiver] = given._replace(neighbours=tuple(about))
            self._events.append(Excuse(sender, receiver))
        return self.observation(receiver)

    def observation(self, board: int) -> bytes:
        """What a board was told in the open tick, once more; or that it is not on the roster."""
        incarnation = self.roster.incarnations[board]
        return encode(self._given[board]._replace(incarnation=incarnation))

    def open(self) -> Iterator[tuple[int, bytes]]:
        """Start the tick: each board that is there, and what it senses, from the ground up."""
        self.body.locked = self.tick < 0
        self._answers = [None if self.roster.present(i) else b"" for i in range(self.size)]
        self._record_sides()
        self._given = {
            board: self._observation(board)
            for board in range(self.size)
            if self.roster.present(board)
        }
        for board, observation in self._given.items():
            yield board, encode(observation)

    def answer(self, board: int, payload: bytes) -> bool:
        """Take a torque frame; tell whether it was the answer that was waited for."""
        try:
            frame = read_answer(
                payload,
                board=board,
                boards=self.size,
                run_id=self.run_id,
                incarnation=self.roster.incarnations[board],
                tick=self.tick,
            )
        except ProtocolError as error:
            self.refuse(board, error.reason)
            return False
        if self._answers[board] is not None:
            return False
        self._answers[board] = payload
        self.actuators.ask(board, frame.torque_nm)
        self.latest[board] = frame
        self.telemetry.counted[board][frame.counter] = frame.counted
        return True

    def report(self, board: int, payload: bytes) -> Failure | None:
        """Take a part of what a board reports of its failure; the whole, if that was the last."""
        about = {"run_id": self.run_id, "incarnation": self.roster.incarnations[board]}
        try:
            failure = self.telemetry.report(board, payload, **about, tick=self.tick)
        except ProtocolError as error:
            self.refuse(board, error.reason)
            return None
        if failure is not None:
            self._events.append(BoardFault(board, failure.code, failure.text))
        return failure

    def refuse(self, board: int, reason: Reason) -> None:
        """Count a frame that came as this board's and is none that could be used."""
        self.refused[reason] += 1
        self.telemetry.refused[board][reason] += 1

    def close(self) -> TickRecord:
        """End the tick: integrate to the next one, and return what happened in this one."""
        assert not self.waiting, "a tick is closed when every board has answered"
        state = tuple(self.body.angles_rad), tuple(self.body.rates_rad_s)
        self._hand_over()
        applied = [0.0] * self.size
        if self.tick >= 0:
            was_tipping = self.actuators.tipping
            applied = self.actuators.torques_nm(self.body, self._attendance.undriven_since)
            if self.actuators.tipping != was_tipping:
                self._events.append(Tipping(not was_tipping))
            self._disturbances.act_on(self.body)
        record = TickRecord(
            self.tick,
            *state,
            tuple(applied),
            tuple(answer or b"" for answer in self._answers),
            tuple(self._events),
        )
        self._events = []
        for board, answer in enumerate(self._answers):
            if answer:
                self.roster.completed_ticks[board] = self.tick
        self.roster.newcomers.clear()
        self._given = {}
        self.body.step(applied)
        self.tick += 1
        for board in sorted(self._leaving):
            self.remove(board, self._leaving[board])
        self._leaving.clear()
        return record

    def outcome(self, wall_s: float, cut_short: str | None = None) -> Outcome:
        """How the run ended, or that it was cut short, and by what."""
        ending = FELL if self.body.fallen else cut_short or COMPLETE
        state = tuple(self.body.angles_rad), tuple(self.body.rates_rad_s)
        return Outcome(self.tick, *state, ending, wall_s, self._attendance.undriven(self.roster))

    def _hand_over(self) -> None:
        """Joints whose boards went during the tick, and those whose boards drive from now on."""
        for board in sorted(self._left):
            self._leave_alone(board)
        self._left.clear()
        for board, since_tick in enumerate(self._attendance.undriven_since):
            if since_tick is not None:
                self._attendance.begin(board, self.latest[board])

    def _leave_alone(self, board: int) -> None:
        event = self._attendance.leave(board, self.tick)
        if event is not None:
            self._events.append(event)

    def _record_sides(self) -> None:
        sides = self.roster.sides()
        if sides != self._sides:
            self._sides = sides
            self._events.append(Sides(tuple(map(tuple, sides))))

    def _observation(self, board: int) -> Observation:
        return Observation(
            self.run_id,
            self.roster.incarnations[board],
            self.tick,
            self.sensors.read(self.body, board, self.tick),
            self.roster.command_for(board),
            self.roster.neighbours_of(board),
        )
