"""The plant: the body with its sensors and actuators, its roster and its agenda.

    command = plant.begin()             a board to put in or take away before the tick
    record = plant.advance(answers)     to the next tick, with the torques that were asked for

Two drivers play it, and differ in whom they wait for: `lockstep` for every board, `free_running`
for none. They decide who is given an observation, and which torque frames answer a tick.

Rule 1: no clock and no I/O. Whoever drives this starts and ends boards. What it decided is recorded
        with its tick.
Rule 2: what happens to the body happens between two ticks. A joint that loses its board or gets one
        in the middle of a tick is braked or released at its end, in whatever order that was heard.
Rule 3: nothing that a torque frame can hold may hurt whoever reads it later, so numbers that no
        board can mean are refused. A torque that is no number is an answer all the same: it is what
        a diverging body makes of an honest board, and nobody can wait for a better one.
"""

from collections import Counter
from collections.abc import Sequence
from typing import assert_never

from plant_server.body.articulated import chain_of
from plant_server.body.body import Body
from plant_server.body.disturbances import Disturbances
from plant_server.hardware.actuators import Actuators
from plant_server.hardware.sensors import Sensors
from plant_server.session.agenda import Agenda, StartUp
from plant_server.session.attendance import Attendance
from plant_server.session.config import PlantConfig
from plant_server.session.record import COMPLETE, FELL, Outcome, TickRecord
from plant_server.session.roster import Roster
from plant_server.session.telemetry import Failure, Telemetry
from protocol.robot.events import (
    Admission,
    BoardFault,
    Departure,
    Disturbance,
    Event,
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
from protocol.wire.frames import Observation, ProtocolError, Reason, TorqueFrame, receive
from protocol.wire.wiring import neighbours


class Plant:
    """The body of one run, and all that is known of its boards."""

    def __init__(self, config: PlantConfig, *, run_id: int) -> None:
        self.config = config
        self.run_id = run_id
        self.size = len(config.joints)
        self.body = Body(
            chain_of(config.links),
            initial_angles_rad=config.initial_angles_rad,
            tick_s=config.run.tick_s,
            substeps=config.run.substeps,
            fallen_below=config.run.fallen_below,
            passive=config.passive,
        )
        cadence = config.cadence
        self.sensors = Sensors(
            config.sensors,
            config.sensor_sheets,
            config.clock_sheets,
            ticks_per_period=cadence.ticks_per_period if cadence else (1,) * self.size,
            seed=config.run.seed,
            tick_s=config.run.tick_s,
        )
        self.actuators = Actuators(
            config.torque_limits_nm, config.motor_sheets, config.foot, tick_s=config.run.tick_s
        )
        self.tick = -config.warm_up_ticks
        self.roster = Roster(self.size, config.standing_links, config.references_rad)
        self.agenda = Agenda(list(config.events))
        self.start_up = StartUp(config, self.agenda)
        self.refused: Counter[Reason] = Counter()
        self.telemetry = Telemetry(self.size)
        self.latest: list[TorqueFrame | None] = [None] * self.size
        """The last torque frame of each board, for whoever wants to know how it is."""
        self.events: list[Event] = []
        """What has happened since the last tick was closed."""
        self._attendance = Attendance(config, self.body)
        self._left: set[int] = set()
        """Boards that are gone since the tick was opened, and did not answer it."""
        self._disturbances = Disturbances()
        self._sides = [list(range(self.size))]

    @property
    def over(self) -> bool:
        """The run has had its ticks, or the body lies on the ground."""
        return self.tick >= self.config.run.ticks or self.body.fallen

    def begin(self) -> Plugging | None:
        """Carry out what is due before the tick is opened. Returns as `obey` does."""
        command = self.agenda.due(self.tick)
        return None if command is None else self.obey(command)

    def obey(self, command: Scheduled) -> Plugging | None:
        """Carry out a command between two ticks.

        Returns what is for the driver to carry out, with `remove` or `admit`.
        """
        self.events.append(command)
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
        self.events.append(Admission(board, incarnation))

    def remove(self, board: int, why: Why, *, midway: bool) -> None:
        """Take a board off the roster: between two ticks, or while one is open."""
        self.roster.remove(board)
        self.latest[board] = None
        self.telemetry.forget(board)
        self.actuators.forget(board)
        # A board that has been given its observation may have acted on it before it went.
        self.events.append(MidwayDeparture(board, why) if midway else Departure(board, why))
        if midway:
            self._left.add(board)
        else:
            self._leave_alone(board)

    def start_tick(self) -> None:
        """Hold the body while it warms up, and record which boards can reach each other."""
        self.body.locked = self.tick < 0
        sides = self.roster.sides()
        if sides != self._sides:
            self._sides = sides
            self.events.append(Sides(tuple(map(tuple, sides))))

    def observation(self, board: int) -> Observation:
        """Read a board's sensors, and say what else it is to know in this tick."""
        return Observation(
            self.run_id,
            self.roster.incarnations[board],
            self.tick,
            self.sensors.read(self.body, board, self.tick),
            self.roster.command_for(board),
            self.roster.neighbours_of(board),
        )

    def read_answer(self, board: int, payload: bytes, *, tick: int | None) -> TorqueFrame:
        """Read and check a torque frame, of any tick if `tick` is None. Raises `ProtocolError`."""
        frame, out_of_range = receive(TorqueFrame, payload)
        if frame.run_id != self.run_id:
            raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
        if frame.incarnation != self.roster.incarnations[board]:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
        if tick is not None and frame.tick != tick:
            raise ProtocolError(Reason.TICK, f"tick {frame.tick}, not {tick}")
        if out_of_range is not None:
            raise out_of_range
        receipts = len(frame.links)
        if frame.candidate >= self.size or receipts != len(neighbours(board, self.size)):
            raise ProtocolError(Reason.RANGE, f"candidate {frame.candidate}, {receipts} receipts")
        return frame

    def report(self, board: int, payload: bytes, *, tick: int | None) -> Failure | None:
        """Take a part of what a board reports of its failure; the whole, if that was the last.

        `tick` is the only one of which it may be; None: any.
        """
        about = {"run_id": self.run_id, "incarnation": self.roster.incarnations[board]}
        try:
            failure = self.telemetry.report(board, payload, **about, tick=tick)
        except ProtocolError as error:
            self.refuse(board, error.reason)
            return None
        if failure is not None:
            self.events.append(BoardFault(board, failure.code, failure.text))
        return failure

    def refuse(self, board: int, reason: Reason) -> None:
        """Count a frame that came as this board's and is none that could be used."""
        self.refused[reason] += 1
        self.telemetry.refused[board][reason] += 1

    def advance(self, answers: Sequence[bytes]) -> TickRecord:
        """End the tick: integrate to the next one, and return what happened in this one.

        `answers` are the torque frames that the record shows; empty where there was none.
        """
        state = tuple(self.body.angles_rad), tuple(self.body.rates_rad_s)
        self._hand_over()
        applied = [0.0] * self.size
        if self.tick >= 0:
            was_tipping = self.actuators.tipping
            applied = self.actuators.torques_nm(self.body, self._attendance.undriven_since)
            if self.actuators.tipping != was_tipping:
                self.events.append(Tipping(not was_tipping))
            self._disturbances.act_on(self.body)
        record = TickRecord(self.tick, *state, tuple(applied), tuple(answers), tuple(self.events))
        self.events = []
        for board, answer in enumerate(answers):
            if answer:
                self.roster.completed_ticks[board] = self.tick
        self.roster.newcomers.clear()
        self.body.step(applied)
        self.tick += 1
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
            self.events.append(event)
