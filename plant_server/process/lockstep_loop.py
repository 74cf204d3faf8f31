"""Ticks of a plant process in lockstep: open, wait for every board, close.

At a pace, this thread waits between two ticks for the wall clock as well, and looks at once at what
comes meanwhile.
"""

import time
from contextlib import suppress
from queue import Empty

import zenoh

from plant_server.process.board_processes import BoardProcesses
from plant_server.process.network import STALLED, Event
from plant_server.session.lockstep import Lockstep
from plant_server.session.pace import Pace
from plant_server.session.record import TickWallTimes
from protocol.process.stopping import undisturbed
from protocol.robot.events import Plug, Unplug
from protocol.wire.wiring import neighbours

STALL_AFTER_S = 1.0


class PlantLockstepLoop:
    """Plays a plant that waits for its boards."""

    def __init__(
        self,
        lockstep: Lockstep,
        boards: BoardProcesses,
        *,
        patience_s: float | None,
        pace: Pace | None,
    ) -> None:
        self.lockstep = lockstep
        self.boards = boards
        self.released_s: float | None = None
        """When tick 0 released the body."""
        self._network = boards.network
        self._recorder = boards.recorder
        self._patience_s = patience_s
        self._pace = pace
        self._starved: dict[int, int] = {}
        """Boards that say whose frame they wait for."""

    def play(self) -> None:
        """Play one tick, and what comes before it."""
        self._wait_until_due()
        self._boundary()
        self._tick()

    def finish(self) -> None:
        """Tell by how much the run did not keep its pace. It may be the host, or a board."""
        pace = self._pace
        if pace is not None and pace.slipped_s > 0.0:
            self.boards.console.tell(
                f"the run did not keep pace {pace.pace:g}:"
                f" {pace.slipped_s:.2f} s of wall time were given up"
            )

    def _wait_until_due(self) -> None:
        pace, tick = self._pace, self.lockstep.plant.tick
        while pace is not None and (wait_s := pace.wait_s(tick, time.monotonic())) > 0.0:
            with suppress(Empty):
                self.boards.handle(self._network.events.get(timeout=wait_s))

    def _boundary(self) -> None:
        """Between two ticks: boards come and go."""
        plant, boards = self.lockstep.plant, self.boards
        match plant.begin():
            case Unplug(board) if plant.roster.present(board):
                boards.kill(board)
                boards.wait_until_gone(board)
            case Plug(board) if not plant.roster.present(board):
                boards.start(board)
                boards.wait_for(board)
                boards.admit(board)
        boards.admit_newcomers()

    def _tick(self) -> None:
        lockstep, boards = self.lockstep, self.boards
        if lockstep.plant.tick == 0:
            self.released_s = time.monotonic()
        boards.answered_ns = [0] * len(boards.joints)
        opened_ns = time.monotonic_ns()
        for board, payload in lockstep.open():
            self._network.observe(board, payload)
        if self._recorder is not None:
            self._recorder.write(self._network.reports())
        patience_s = self._patience_s or STALL_AFTER_S
        while lockstep.waiting:
            try:
                self._handle(self._network.events.get(timeout=patience_s))
            except Empty:
                self._lose_patience()
            boards.look_for_storms()
        self._starved.clear()
        walls = TickWallTimes(opened_ns, tuple(boards.answered_ns), time.monotonic_ns())
        with undisturbed:  # A body that is half way to the next tick is no ending.
            record = lockstep.close()
            if self._recorder is not None:
                self._recorder.keep(record, walls)
        boards.console.show(record.tick, self.released_s)

    def _handle(self, event: "zenoh.Sample | Event") -> None:
        """Take what comes while a tick is open."""
        if not isinstance(event, tuple):
            self.boards.handle(event)
        elif event[0] == STALLED:
            self._starve(event[1])
        else:
            self.boards.handle(event)
            self._excuse_orphans()  # Somebody may have gone.

    def _starve(self, sample: zenoh.Sample) -> None:
        """A board waits for a frame, which never comes if its sender is gone; or it hangs."""
        frame = self.boards.stalled(sample)
        if frame is None:
            return
        board, plant = self.boards.board_of(sample), self.lockstep.plant
        current = (plant.run_id, plant.roster.incarnations[board], plant.tick)
        if frame[:3] != current or board not in self.lockstep.waiting_for:
            return
        if frame.sender == board:
            self.boards.watch.stuck[board] += 1
            joint = self.boards.joints[board]
            self.boards.console.tell(
                f"{joint} is stuck in tick {frame.tick}; its own line says where"
            )
        elif frame.sender in neighbours(board, plant.size):
            self._starved[board] = frame.sender
            self._excuse_orphans()

    def _lose_patience(self) -> None:
        """Nothing came for a while: say who is waited for; without endless patience, go on."""
        lockstep, joints = self.lockstep, self.boards.joints
        slow = lockstep.waiting_for
        waits = f"tick {lockstep.plant.tick} waits for"
        self.boards.console.tell(f"{waits} {', '.join(joints[board] for board in slow)}")
        for board in slow:
            if board in self._starved:
                if self._patience_s is not None:
                    self._excuse(board)
            elif self._patience_s is None:
                self._network.observe(board, lockstep.observation(board))
            else:
                self._dismiss(board)

    def _excuse(self, board: int) -> None:
        """Let a board go on without the frame that it waits for."""
        sender = self._starved.pop(board)
        self._network.observe(board, self.lockstep.excuse(sender, board))

    def _excuse_orphans(self) -> None:
        """Let boards go on whose missing frame will never come, because its sender is gone."""
        for board, sender in list(self._starved.items()):
            if not self.lockstep.plant.roster.present(sender):
                self._excuse(board)

    def _dismiss(self, board: int) -> None:
        """Give up on a silent board; should it wake up, it learns so, and may enrol again."""
        boards = self.boards
        boards.enrolment.dismiss(board)
        self.lockstep.remove(board, "silent")
        self._excuse_orphans()
        self._network.observe(board, self.lockstep.observation(board))
        boards.console.tell(f"{boards.joints[board]} was silent for too long; going on without it")
