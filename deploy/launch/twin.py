"""The twin: the same boards and the same plant in one process, exchanging the same bytes.

A board cannot tell whether its frames came over Zenoh or from here, so the trajectory is the same
to the bit, and a run can be studied in a debugger.
"""

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from module_agent.assembly import assemble
from module_agent.custom import sandbox
from module_agent.firmware.board import Actuation, Board
from module_agent.firmware.config import board_config
from plant_server.session.config import plant_config
from plant_server.session.lockstep import Lockstep
from plant_server.session.plant import Plant
from plant_server.session.record import Outcome, TickRecord
from protocol.robot.events import Plug, Unplug, Why
from protocol.robot.scenario import Scenario, run_id
from protocol.wire.frames import Observation


class Twin:
    """One robot in one process.

    `tick` and `run` play it as it is. A replay, or whoever disturbs it, plays the same steps with
    others in between: `boundary`, `lockstep.open`, `answer`, `deliver`, `lockstep.close`.
    """

    def __init__(self, scenario: Scenario, *, empty: bool = False) -> None:
        """Plug in a board for every joint; for none if it is to be `empty`.

        Raises `ScenarioError` when a controller's file is not the one that the scenario means.
        """
        self.scenario = scenario
        for joint in scenario.joints:
            sandbox.check(board_config(scenario, joint))
        self.lockstep = Lockstep(Plant(plant_config(scenario), run_id=run_id(scenario.digest)))
        self.boards: list[Board | None] = [None] * len(scenario.joints)
        self._incarnations = [0] * len(scenario.joints)
        if not empty:
            for board in range(len(scenario.joints)):
                self.plug(board)

    def run(self) -> Iterator[TickRecord]:
        """Play ticks, warm-up included, until the run is over."""
        with _no_collector():
            while not self.lockstep.plant.over:
                yield self.tick()

    def tick(self) -> TickRecord:
        """Play one tick of all processes, in an order that no board can notice."""
        self.think()
        return self.lockstep.close()

    def think(self) -> None:
        """Open a tick, and have every board think. What they do not come back from can be stopped.

        The body has not moved yet: `lockstep.close` does that.
        """
        self.boundary(self.plug)
        for board, payload in self.lockstep.open():
            firmware = self.boards[board]
            assert firmware is not None
            actuation = self.answer(firmware, firmware.read(payload))
            for receiver, frame in zip(firmware.config.neighbours, actuation.links, strict=True):
                self.deliver(board, receiver, frame)

    def boundary(self, plug: Callable[[int], None]) -> None:
        """Between two ticks: take away or `plug` in the board that the plant asks for."""
        match self.lockstep.plant.begin():
            case Unplug(board):
                self.remove(board, "unplugged")
            case Plug(board):
                plug(board)

    def answer(self, firmware: Board, observation: Observation) -> Actuation:
        """Have a board think about the open tick, and give the plant its answer."""
        actuation = firmware.tick(observation)
        board = firmware.config.index
        for fault in actuation.faults:
            self.lockstep.report(board, fault)
        self.lockstep.answer(board, actuation.torque)
        return actuation

    def deliver(self, sender: int, receiver: int, frame: bytes) -> None:
        """Bring a link frame to the board of the joint that it is for, if there is one."""
        firmware = self.boards[receiver]
        if firmware is not None:
            firmware.hear(firmware.config.neighbours.index(sender), frame)

    def plug(self, board: int) -> None:
        """Put in a board that has just been switched on, if the joint has none."""
        if self.boards[board] is None:
            self.admit(self.boot(board))

    def boot(self, board: int) -> Board:
        """Switch on the next board of a joint, without letting it in."""
        self._incarnations[board] += 1
        config = board_config(self.scenario, self.scenario.joints[board])
        run_id = self.lockstep.plant.run_id
        return assemble(config, run_id=run_id, incarnation=self._incarnations[board])

    def admit(self, firmware: Board) -> None:
        """Give a joint to a board."""
        board = firmware.config.index
        self.boards[board] = firmware
        self.lockstep.plant.admit(board, firmware.incarnation)

    def remove(self, board: int, why: Why) -> None:
        """Take a board away."""
        self.boards[board] = None
        self.lockstep.remove(board, why)


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
    return records, twin.lockstep.plant.outcome(time.perf_counter() - started)
