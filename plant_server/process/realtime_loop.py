"""Ticks of a plant process in realtime: by the wall clock, and nobody is waited for.

Rule 1: between two ticks this thread sleeps, and looks at what has come when the next one is due.
Rule 2: a host that is too slow is told by how much, seldom, and the run is played to its end.
Rule 3: boards are started and ended, and come and go, while the body moves. A board that has lost
        its token, or has been silent for the lease, is gone.
"""

import time

from plant_server.process.board_processes import BoardProcesses
from plant_server.session.free_running import FreeRunning
from plant_server.session.pace import Pace
from plant_server.session.record import TickWallTimes
from plant_server.spool.spool import PLANT
from protocol.process.stopping import undisturbed
from protocol.robot.events import Plug, StaleTorque, Unplug

COMPLAIN_EVERY_S = 1.0


class PlantRealtimeLoop:
    """Plays a plant that waits for nobody but the wall clock."""

    def __init__(self, running: FreeRunning, boards: BoardProcesses, *, pace: Pace) -> None:
        self.running = running
        self.boards = boards
        self.released_s: float | None = None
        """When tick 0 released the body."""
        self._network = boards.network
        self._recorder = boards.recorder
        self._pace = pace
        self._complained_s = 0.0

    def play(self) -> None:
        """Play one tick, and what comes before it."""
        self._wait_until_due()
        self._boundary()
        self._tick()

    def finish(self) -> None:
        """Keep how far behind the host was, and tell it."""
        pace = self._pace
        if self._recorder is not None:
            account = {"behind_ms_max": pace.behind_s_max * 1e3, "slipped_s": pace.slipped_s}
            self._recorder.keep_realtime(PLANT, account)
        if pace.slipped_s > 0.0:
            self.boards.console.tell(
                "the host is too slow for realtime:"
                f" {pace.slipped_s:.2f} s of wall time were given up"
            )

    def _wait_until_due(self) -> None:
        tick, events = self.running.plant.tick, self._network.events
        while (wait_s := self._pace.wait_s(tick, time.monotonic())) > 0.0:
            time.sleep(wait_s)
        while not events.empty():
            self.boards.handle(events.get())

    def _boundary(self) -> None:
        """Between two ticks: boards come and go, and nobody waits until they have."""
        plant, boards = self.running.plant, self.boards
        match plant.begin():
            case Unplug(board) if plant.roster.present(board):
                boards.kill(board)
            case Plug(board) if not plant.roster.present(board):
                boards.start(board)
        boards.admit_newcomers()

    def _tick(self) -> None:
        running, boards = self.running, self.boards
        if running.plant.tick == 0:
            self.released_s = time.monotonic()
        opened_ns = time.monotonic_ns()
        for board, payload in running.open():
            self._network.observe(board, payload)
        walls = TickWallTimes(opened_ns, tuple(boards.answered_ns), time.monotonic_ns())
        boards.answered_ns = [0] * len(boards.joints)
        with undisturbed:  # A body that is half way to the next tick is no ending.
            record = running.close()
            if self._recorder is not None:
                self._recorder.keep(record, walls)
                self._recorder.write(())
        for event in record.events:
            if isinstance(event, StaleTorque):
                self._complain(event.board)
        boards.look_for_storms()
        boards.console.show(record.tick, self.released_s)

    def _complain(self, board: int) -> None:
        now_s = time.monotonic()
        if now_s - self._complained_s >= COMPLAIN_EVERY_S:
            self._complained_s = now_s
            plant, boards = self.running.plant, self.boards
            age_ms = self.running.cadence.age_ticks_max * plant.config.run.tick_s * 1e3
            boards.console.tell(
                f"{boards.joints[board]}'s torque was older than {age_ms:g} ms at tick"
                f" {plant.tick - 1}, for no newer one had come; 0 N m until one does"
            )
