"""The plant in realtime: the body goes on, whether its boards have said something or not.

    command = running.plant.begin()        as in lockstep
    observations = running.open()          for the boards whose period begins with this tick
    running.answer(board, payload)         at any time between two ticks
    running.take_trace(board, payload)          as above: what a board says of its own time
    record = running.close()               with the torques that are in force

Rule 1: a board gets an observation in each tick that is a multiple of its ticks per period. So all
        that boards know of the body is sampled in ticks that they can name alike.
Rule 2: the latest torque of a board is in force until a newer one comes; older ones change nothing.
Rule 3: a torque ages from the tick in which the board said it, by its own estimate, or that in
        which it came, whichever is earlier. One that is too old is not applied (0 N m), until a
        newer one comes.
Rule 4: the record of a tick has the torque frames in force in it, whenever they came.

Nobody is waited for, so a board comes and goes between two ticks, and not at a tick's end (S5).
"""

from collections.abc import Iterator
from dataclasses import dataclass

from plant_server.hardware.actuators import SAFE_TORQUE_NM
from plant_server.session.plant import Plant
from plant_server.session.record import TickRecord
from plant_server.session.telemetry import Failure
from protocol.robot.events import FreshTorque, StaleTorque, Why
from protocol.wire.frames import ProtocolError, Reason, TorqueFrame, encode
from protocol.wire.trace import LastWord, Mark
from protocol.wire.trace_differences import decode_told


@dataclass(slots=True)
class RealtimeAccount:
    """How a board keeps its deadlines, by what it has told so far."""

    periods: int = 0
    missed: int = 0
    """Periods whose torque was late, or never came."""
    late_us_max: int = 0
    """How late it woke up, at worst."""


class FreeRunning:
    """A plant that waits for nobody."""

    def __init__(self, plant: Plant) -> None:
        assert plant.config.cadence is not None, "the scenario is one of realtime"
        self.plant = plant
        self.cadence = plant.config.cadence
        self.stale_ticks = [0] * plant.size
        """Ticks in which a board's torque was too old to be applied."""
        self.said_ticks = [0] * plant.size
        """From when on the torque in force of each board ages."""
        self.tallies = [RealtimeAccount() for _ in range(plant.size)]
        self._in_force: list[bytes] = [b""] * plant.size
        self._stale = [False] * plant.size

    def remove(self, board: int, why: Why) -> None:
        """Take a board off the roster, and its torque out of force."""
        if self.plant.roster.present(board):
            self.plant.remove(board, why, midway=False)

    def open(self) -> Iterator[tuple[int, bytes]]:
        """Start the tick: what each board senses whose period begins with it."""
        plant = self.plant
        plant.start_tick()
        for board, period in enumerate(self.cadence.ticks_per_period):
            if plant.tick % period == 0 and plant.roster.present(board):
                yield board, encode(plant.observation(board))

    def answer(self, board: int, payload: bytes) -> bool:
        """Take a torque frame; tell whether it is in force now."""
        plant = self.plant
        try:
            frame = self._read(board, payload)
        except ProtocolError as error:
            plant.refuse(board, error.reason)
            return False
        plant.telemetry.counted[board][frame.counter] = frame.counted
        latest = plant.latest[board]
        if latest is not None and frame.tick <= latest.tick:
            return False
        self._in_force[board] = payload
        self.said_ticks[board] = min(frame.tick, plant.tick)
        plant.actuators.ask(board, frame.torque_nm)
        plant.latest[board] = frame
        return True

    def report(self, board: int, payload: bytes) -> Failure | None:
        """Take a part of what a board reports of its failure, in whichever tick that was."""
        return self.plant.report(board, payload, tick=None)

    def take_trace(self, board: int, payload: bytes) -> bool:
        """Take what a board tells of its time; tell whether it is of this run."""
        plant = self.plant
        try:
            told = decode_told(payload)
        except ProtocolError as error:
            plant.refuse(board, error.reason)
            return False
        if told.run_id != plant.run_id:
            plant.refuse(board, Reason.RUN)
            return False
        if isinstance(told, LastWord):
            return True
        tally = self.tallies[board]
        for tick in told.lived:
            tally.periods += 1 + tick.skipped
            tally.missed += tick.skipped + bool(tick.marks & Mark.LATE)
            tally.late_us_max = max(tally.late_us_max, tick.late_us)
        return True

    def close(self) -> TickRecord:
        """End the tick: integrate to the next one with the torques in force."""
        return self.plant.advance([self._usable_answer(board) for board in range(self.plant.size)])

    def _read(self, board: int, payload: bytes) -> TorqueFrame:
        frame, tick = self.plant.read_answer(board, payload, tick=None), self.plant.tick
        if frame.tick > tick + self.cadence.ahead_ticks_max:
            raise ProtocolError(Reason.TICK, f"tick {frame.tick} is far ahead of {tick}")
        return frame

    def _usable_answer(self, board: int) -> bytes:
        """The torque frame in force, unless it is too old."""
        plant = self.plant
        if plant.latest[board] is None:
            self._stale[board] = False
            return b""
        stale = plant.tick - self.said_ticks[board] > self.cadence.age_ticks_max
        if stale != self._stale[board]:
            self._stale[board] = stale
            plant.events.append(StaleTorque(board) if stale else FreshTorque(board))
        if not stale:
            return self._in_force[board]
        self.stale_ticks[board] += 1
        plant.actuators.ask(board, SAFE_TORQUE_NM)
        return b""
