"""Lockstep: the body and its boards advance together, tick by tick.

    command = lockstep.plant.begin()        a board to put in or take away before the tick
    observations = lockstep.open()          one encoded frame for each board that is there
    lockstep.answer(board, payload)         in any order, any number of times
    record = lockstep.close()               when nobody is waited for any more

Rule 1: the tick k is over when every board of the roster has answered it. Answers are a set.
Rule 2: ticks -W ... -1 are the warm-up: the normal barrier, with the body locked in its initial
        posture and torques answered but not applied, until every delay line is full. Tick 0
        releases the body (S8).
Rule 3: whoever drives this decides how long it waits.
"""

from collections.abc import Iterator

from plant_server.session.plant import Plant
from plant_server.session.record import TickRecord
from plant_server.session.telemetry import Failure
from protocol.robot.events import Excuse, Why
from protocol.wire.frames import Observation, ProtocolError, encode
from protocol.wire.wiring import neighbours


class Lockstep:
    """A plant that waits for its boards."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._answers: list[bytes | None] = [None] * plant.size
        self._given: dict[int, Observation] = {}
        """What each board was told in the open tick; empty between two ticks."""
        self._leaving: dict[int, Why] = {}
        """Boards that are gone since they answered the open tick, and why."""

    @property
    def waiting(self) -> bool:
        """Whether a board has not answered the open tick."""
        return None in self._answers

    @property
    def waiting_for(self) -> list[int]:
        """Boards that have not answered the open tick."""
        return [i for i, answer in enumerate(self._answers) if answer is None]

    def remove(self, board: int, why: Why) -> None:
        """Take a board off the roster: at once, or after the tick that it has answered (S5)."""
        if not self.plant.roster.present(board):
            return
        if self._given and self._answers[board]:
            self._leaving.setdefault(board, why)
            return
        self._answers[board] = b""
        self.plant.remove(board, why, midway=bool(self._given))

    def excuse(self, sender: int, receiver: int) -> bytes:
        """Let a board go on without a link frame in the open tick; the observation that says so.

        Should the frame come after all, it is not used, so that the verdict has one meaning (S6).
        """
        plant = self.plant
        given, near = self._given[receiver], neighbours(receiver, plant.size)
        if sender in near and given.neighbours[near.index(sender)].waits:
            about = list(given.neighbours)
            link = near.index(sender)
            completed_tick = min(about[link].completed_tick, plant.tick - 2)
            about[link] = about[link]._replace(completed_tick=completed_tick, waits=0)
            self._given[receiver] = given._replace(neighbours=tuple(about))
            plant.events.append(Excuse(sender, receiver))
        return self.observation(receiver)

    def observation(self, board: int) -> bytes:
        """What a board was told in the open tick, once more; or that it is not on the roster."""
        incarnation = self.plant.roster.incarnations[board]
        return encode(self._given[board]._replace(incarnation=incarnation))

    def open(self) -> Iterator[tuple[int, bytes]]:
        """Start the tick: each board that is there, and what it senses, from the ground up."""
        plant = self.plant
        plant.start_tick()
        there = [plant.roster.present(board) for board in range(plant.size)]
        self._answers = [None if present else b"" for present in there]
        self._given = {
            board: plant.observation(board) for board, present in enumerate(there) if present
        }
        for board, observation in self._given.items():
            yield board, encode(observation)

    def answer(self, board: int, payload: bytes) -> bool:
        """Take a torque frame; tell whether it was the answer that was waited for."""
        plant = self.plant
        try:
            frame = plant.read_answer(board, payload, tick=plant.tick)
        except ProtocolError as error:
            plant.refuse(board, error.reason)
            return False
        if self._answers[board] is not None:
            return False
        self._answers[board] = payload
        plant.actuators.ask(board, frame.torque_nm)
        plant.latest[board] = frame
        plant.telemetry.counted[board][frame.counter] = frame.counted
        return True

    def report(self, board: int, payload: bytes) -> Failure | None:
        """Take a part of what a board reports of its failure in the open tick."""
        return self.plant.report(board, payload, tick=self.plant.tick)

    def close(self) -> TickRecord:
        """End the tick: integrate to the next one, and return what happened in this one."""
        assert not self.waiting, "a tick is closed when every board has answered"
        record = self.plant.advance([answer or b"" for answer in self._answers])
        self._given = {}
        for board in sorted(self._leaving):
            self.remove(board, self._leaving[board])
        self._leaving.clear()
        return record
