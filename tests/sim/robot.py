"""The robot of the hunt: the twin, in which boards die, freeze, come and go at any moment.

Rule 1: boards and plant are the product's own. Only what lies between them is made up.
Rule 2: `answered` is what a board is known to have said before it died; laws compare with it.
"""

from typing import NamedTuple

from deploy.launch.twin import Twin
from module_agent.assembly import assemble
from module_agent.firmware.board import Board, ReplacedError
from module_agent.firmware.config import board_config
from plant_server.record import TickRecord
from protocol.robot import sensors
from protocol.robot.events import LinkRepair, Plug, SensorFault
from protocol.wire.frames import ProtocolError
from protocol.wire.wiring import neighbours
from tests.sim.adversary import Adversary, Fate
from tests.sim.broken import BrokenLawError
from tests.sim.noise import PLANT, Noise
from tests.sim.plans import Plan


class Frozen(NamedTuple):
    """A board that has stopped in the middle of a tick."""

    firmware: Board
    observation: bytes
    farewell: bytes
    """What the plant told it when it went on without it."""


class Newcomer(NamedTuple):
    """A board that is enrolled, and not on the roster before it has its links up."""

    firmware: Board
    incarnation: int
    ready_tick: int


class Robot(Twin):
    """One robot in one process, among enemies."""

    def __init__(self, plan: Plan, *, quiet: bool = False) -> None:
        self.adversary = Adversary(plan)
        self.noise = Noise(plan.seed, plan.rates.garbage, quiet=quiet)
        self.newcomers: dict[int, Newcomer] = {}
        self.asleep: list[Frozen] = []
        self.answered: dict[int, bytes] = {}
        """Of the last tick: the answer of each board that the plant got in time."""
        self.ticked: dict[int, Board] = {}
        """Of the last tick: the boards that lived through it, or died when they had answered."""
        self.rostered: tuple[int, ...] = ()
        """Of the last tick: who drove each joint when it was opened, 0 for nobody."""
        self.excused: set[tuple[int, int]] = set()
        """Of the last tick: links (sender, receiver) that the plant did not wait for."""
        self.said: list[bytes] = []
        """Of the last tick: link frames."""
        self._late: list[tuple[int, int, bytes]] = []
        """Frames that reach their receiver when it has ticked: sender, receiver, payload."""
        super().__init__(plan.scenario)

    def tick(self) -> TickRecord:
        """Play one tick: the boundary, then boards in some order, with what befalls them."""
        lockstep = self.lockstep
        self.adversary.command(lockstep)
        self._boundary()
        self.answered, self.ticked = {}, {}
        self.said, self._late = [], []
        observations = list(lockstep.open())
        self.rostered = tuple(lockstep.roster.incarnations)
        sensed = {board: self.adversary.sensed(board, payload) for board, payload in observations}
        fates = {board: self.adversary.fate() for board, _ in observations}
        self.excused = set()
        for board, _ in observations:
            sender = self.adversary.excuses(neighbours(board, lockstep.size))
            if sender is not None:
                sensed[board] = lockstep.excuse(sender, board)
                self.excused.add((sender, board))
        late = next((board for board, fate in fates.items() if fate is Fate.DIES_AFTER), None)
        for board, payload in observations:
            if fates[board] in (Fate.DIES_BEFORE, Fate.DIES_SPEAKING, Fate.FREEZES):
                self._lose(board, payload, fates[board])
        self.noise.disturb_plant(lockstep)
        for board, _payload in self.noise.shuffled(observations):
            if fates[board] in (Fate.LIVES, Fate.DIES_AFTER):
                self._play(board, sensed[board])
                if board == late:
                    self.boards[board] = None
                    if lockstep.waiting:
                        lockstep.remove(board, "died")
        self._wake_up()
        self._deliver_said()
        record = lockstep.close()
        if late is not None:
            lockstep.remove(late, "died")
        return record

    def heal(self) -> None:
        """End all faults: perfect links and sensors, a board on every joint, nobody frozen."""
        self.adversary.healed = True
        agenda, tick = self.lockstep.agenda, self.lockstep.tick
        agenda.add(max(tick, self.adversary.until), LinkRepair(()))
        for board in range(len(self.boards)):
            whole = SensorFault(board, sensors.ALL, sensors.OK, 0.0, 0)
            agenda.add(max(tick, self.adversary.until) + 1, whole)
            agenda.add(max(tick, self.adversary.until) + 1, Plug(board))

    @property
    def healed(self) -> bool:
        """Whether everything that `heal` asked for has come about."""
        idle = self.adversary.healed and not self.lockstep.agenda._entries
        return idle and all(self.boards) and not any(self.lockstep.roster._outboxes)

    def _boundary(self) -> None:
        super()._boundary()
        for board, firmware in enumerate(self.boards):
            if firmware is None:
                self._come(board)

    def _come(self, board: int) -> None:
        """A board that nobody has announced: it enrols, and joins when its links are up."""
        newcomer, tick = self.newcomers.get(board), self.lockstep.tick
        if newcomer is None:
            wait_ticks = self.adversary.enrols()
            if wait_ticks is not None:
                self._enrol(board, tick + wait_ticks)
        elif newcomer.ready_tick <= tick and not self.lockstep.agenda.expects_plug(board):
            self._plug(board)

    def _enrol(self, board: int, ready_tick: int) -> None:
        self._incarnations[board] += 1
        config = board_config(self.scenario, self.scenario.joints[board])
        firmware = assemble(config, run_id=self.run_id, incarnation=self._incarnations[board])
        self.newcomers[board] = Newcomer(firmware, self._incarnations[board], ready_tick)

    def _plug(self, board: int) -> None:
        newcomer = self.newcomers.pop(board, None)
        if newcomer is None:
            super()._plug(board)
        else:
            assert self.boards[board] is None
            self.boards[board] = newcomer.firmware
            self.lockstep.admit(board, newcomer.incarnation)

    def _play(self, board: int, payload: bytes) -> None:
        firmware = self.boards[board]
        assert firmware is not None
        self.noise.disturb_board(firmware)
        observation = firmware.read(payload)
        link = firmware.missing(observation)
        if link is not None:
            sender = firmware.config.neighbours[link]
            detail = f"{board} waits for the frame of {sender}, {observation.neighbours[link]}"
            raise BrokenLawError("S6 nobody waits for a frame that cannot come", detail)
        actuation = firmware.tick(observation)
        self.answered[board], self.ticked[board] = actuation.torque, firmware
        self.lockstep.answer(board, actuation.torque)
        if self.noise.happens():
            self.lockstep.answer(board, actuation.torque)
        self.noise.remember(board, PLANT, actuation.torque)
        self._say(firmware, actuation.links, deaf=False)

    def _lose(self, board: int, payload: bytes, fate: Fate) -> None:
        firmware = self.boards[board]
        assert firmware is not None
        self.boards[board] = None
        if fate is Fate.FREEZES:
            self.lockstep.remove(board, "silent")
            self.asleep.append(Frozen(firmware, payload, self.lockstep.observation(board)))
            return
        if fate is Fate.DIES_SPEAKING:
            actuation = firmware.tick(firmware.read(payload))
            self._say(firmware, actuation.links, deaf=self.noise.quiet)
        self.lockstep.remove(board, "died")

    def _wake_up(self) -> None:
        """Let frozen boards go on where they stopped; what they say is of no use to anybody."""
        still = []
        for frozen in self.asleep:
            if not self.adversary.wakes():
                still.append(frozen)
                continue
            firmware = frozen.firmware
            board = firmware.config.index
            actuation = firmware.tick(firmware.read(frozen.observation))
            self._say(firmware, actuation.links, deaf=self.noise.quiet)
            self.lockstep.answer(board, actuation.torque)
            try:
                firmware.read(frozen.farewell)
            except (ReplacedError, ProtocolError):
                continue
            raise BrokenLawError("S2 a board that was replaced stops", f"{board} goes on")
        self.asleep = still

    def _say(self, sender: Board, payloads: tuple[bytes, ...], *, deaf: bool) -> None:
        """Put frames on the way; some arrive before their receiver ticks, some twice."""
        if deaf:
            return
        for receiver, payload in zip(sender.config.neighbours, payloads, strict=True):
            self.noise.remember(sender.config.index, receiver, payload)
            early = self.noise.happens()
            if early:
                self._bring(sender.config.index, receiver, payload)
            if not early or self.noise.happens():
                self._late.append((sender.config.index, receiver, payload))
            self.said.append(payload)

    def _deliver_said(self) -> None:
        for sender, receiver, payload in self.noise.shuffled(self._late):
            self._bring(sender, receiver, payload)

    def _bring(self, sender: int, receiver: int, payload: bytes) -> None:
        firmware = self.boards[receiver]
        if firmware is None and not self.noise.quiet and receiver in self.newcomers:
            firmware = self.newcomers[receiver].firmware
        if firmware is not None:
            firmware.hear(firmware.config.neighbours.index(sender), payload)
