"""The twin: the same boards and the same plant in one process, exchanging the same bytes.

A board cannot tell whether its frames came over Zenoh or from here, so the trajectory is the same
to the bit, and a run can be studied in a debugger.
"""

import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager

from module_agent.assembly import assemble
from module_agent.custom import sandbox
from module_agent.firmware.board import Board
from module_agent.firmware.config import board_config
from plant_server.record import Outcome, TickRecord
from plant_server.session.config import plant_config
from plant_server.session.lockstep import Lockstep
from protocol.robot.events import Plug, Unplug
from protocol.robot.scenario import Scenario, run_id


class Twin:
    """One robot in one process.

    Raises `ScenarioError` when a controller's file is not the one that the scenario means.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        for joint in scenario.joints:
            sandbox.check(board_config(scenario, joint))
        self.run_id = run_id(scenario.digest)
        self.lockstep = Lockstep(plant_config(scenario), run_id=self.run_id)
        self.boards: list[Board | None] = [None] * len(scenario.joints)
        self._incarnations = [0] * len(scenario.joints)
        for board in range(len(scenario.joints)):
            self._plug(board)

    def tick(self) -> TickRecord:
        """Play one tick of all processes, in an order that no board can notice."""
        self.think()
        return self.lockstep.close()

    def think(self) -> None:
        """Open a tick, and have every board think. What they do not come back from can be stopped.

        The body has not moved yet: `lockstep.close` does that.
        """
        lockstep = self.lockstep
        self._boundary()
        for index, payload in lockstep.open():
            firmware = self.boards[index]
            assert firmware is not None
            actuation = firmware.tick(firmware.read(payload))
            for fault in actuation.faults:
                lockstep.report(index, fault)
            lockstep.answer(index, actuation.torque)
            self._deliver(firmware, actuation.links)

    def run(self) -> Iterator[TickRecord]:
        """Play ticks, warm-up included, until the run is over."""
        with _no_collector():
            while not self.lockstep.over:
                yield self.tick()

    def _boundary(self) -> None:
        """Between two ticks: take away or put in the board that the plant asks for."""
        match self.lockstep.begin():
            case Unplug(board):
                self.boards[board] = None
                self.lockstep.remove(board, "unplugged")
            case Plug(board):
                self._plug(board)

    def _deliver(self, sender: Board, payloads: tuple[bytes, ...]) -> None:
        index = sender.config.index
        for neighbour, payload in zip(sender.config.neighbours, payloads, strict=True):
            receiver = self.boards[neighbour]
            if receiver is not None:
                receiver.hear(receiver.config.neighbours.index(index), payload)

    def _plug(self, board: int) -> None:
        if self.boards[board] is not None:
            return
        self._incarnations[board] += 1
        incarnation = self._incarnations[board]
        config = board_config(self.scenario, self.scenario.joints[board])
        self.boards[board] = assemble(config, run_id=self.run_id, incarnation=incarnation)
        self.lockstep.admit(board, incarnation)


@contextmanager
def _no_collector() -> Iterator[None]:
    """Leave all memory to reference counts meanwhile.

    No tick makes a cycle (a test counts), and the collector would look again and again at every
    sample that every board keeps: with hundreds of boards, a fifth of the time.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def run_twin(scenario: Scenario) -> tuple[list[TickRecord], Outcome]:
    """Play a whole run and return what a spool would hold."""
    twin = Twin(scenario)
    records = []
    started = time.perf_counter()
    for record in twin.run():
        if record.tick == 0:
            started = time.perf_counter()
        records.append(record)
    return records, twin.lockstep.outcome(time.perf_counter() - started)
