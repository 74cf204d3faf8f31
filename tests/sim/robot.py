"""The robot of the hunt: the twin, in which boards die, freeze, come and go at any moment.

Rule 1: boards and plant are the product's own. Only what lies between them is made up.
Rule 2: `answered` is what a board is known to have said before it died; laws compare with it.
"""

from typing import NamedTuple

from deploy.launch.twin import Twin
from module_agent.firmware.board import Board, ReplacedError
from plant_server.session.record import TickRecord
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
    ready_tick: int


class Robot:
    """One robot in one process, among enemies."""

    def __init__(self, plan: Plan, *, quiet: bool = False) -> None:
        self.twin = Twin(plan.scenario)
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

    def tick(self) -> TickRecord:
        """Play one tick: the boundary, then boards in some order, with what befalls them."""
        lockstep = self.twin.lockstep
        self.adversary.command(lockstep)
        self._boundary()
        self.answered, self.ticked = {}, {}
        self.said, self._late = [], []
        observations = list(lockstep.open())
        self.rostered = tuple(lockstep.plant.roster.incarnations)
        sensed = {board: self.adversary.sensed(board, payload) for board, payload in observations}
        fates = {board: self.adversary.fate() for board, _ in observations}
        self.excused = set()
        for board, _ in observations:
            sender = self.adversary.excuses(neighbours(board, lockstep.plant.size))
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
                    self.twin.boards[board] = None
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
        agenda, tick = self.twin.lockstep.plant.agenda, self.twin.lockstep.plant.tick
        agenda.add(max(tick, self.adversary.until), LinkRepair(()))
        for board in range(len(self.twin.boards)):
            whole = SensorFault(board, sensors.ALL, sensors.OK, 0.0, 0)
            agenda.add(max(tick, self.adversary.until) + 1, whole)
            agenda.add(max(tick, self.adversary.until) + 1, Plug(board))

    @property
    def healed(self) -> bool:
        """Whether everything that `heal` asked for has come about."""
        idle = self.adversary.healed and not self.twin.lockstep.plant.agenda._entries
        return idle and all(self.twin.boards) and not any(self.twin.lockstep.plant.roster._outboxes)

    def _boundary(self) -> None:
        self.twin.boundary(self._plug)
        for board, firmware in enumerate(self.twin.boards):
            if firmware is None:
                self._come(board)

    def _come(self, board: int) -> None:
        """A board that nobody has announced: it enrols, and joins when its links are up."""
        newcomer, tick = self.newcomers.get(board), self.twin.lockstep.plant.tick
        if newcomer is None:
            wait_ticks = self.adversary.enrols()
            if wait_ticks is not None:
                self.newcomers[board] = Newcomer(self.twin.boot(board), tick + wait_ticks)
        elif newcomer.ready_tick <= tick and not self.twin.lockstep.plant.agenda.expects_plug(
            board
        ):
            self._plug(board)

    def _plug(self, board: int) -> None:
        newcomer = self.newcomers.pop(board, None)
        if newcomer is None:
            self.twin.plug(board)
        else:
            assert self.twin.boards[board] is None
            self.twin.admit(newcomer.firmware)

    def _play(self, board: int, payload: bytes) -> None:
        firmware = self.twin.boards[board]
        assert firmware is not None
        self.noise.disturb_board(firmware)
        observation = firmware.read(payload)
        link = firmware.missing(observation)
        if link is not None:
            sender = firmware.config.neighbours[link]
            detail = f"{board} waits for the frame of {sender}, {observation.neighbours[link]}"
            raise BrokenLawError("S6 nobody waits for a frame that cannot come", detail)
        actuation = self.twin.answer(firmware, observation)
        self.answered[board], self.ticked[board] = actuation.torque, firmware
        if self.noise.happens():
            self.twin.lockstep.answer(board, actuation.torque)
        self.noise.remember(board, PLANT, actuation.torque)
        self._say(firmware, actuation.links, deaf=False)

    def _lose(self, board: int, payload: bytes, fate: Fate) -> None:
        firmware = self.twin.boards[board]
        assert firmware is not None
        self.twin.boards[board] = None
        if fate is Fate.FREEZES:
            self.twin.lockstep.remove(board, "silent")
            self.asleep.append(Frozen(firmware, payload, self.twin.lockstep.observation(board)))
            return
        if fate is Fate.DIES_SPEAKING:
            actuation = firmware.tick(firmware.read(payload))
            self._say(firmware, actuation.links, deaf=self.noise.quiet)
        self.twin.lockstep.remove(board, "died")

    def _wake_up(self) -> None:
        """Let frozen boards go on where they stopped; what they say is of no use to anybody."""
        still = []
        for frozen in self.asleep:
            if not self.adversary.wakes():
                still.append(frozen)
                continue
            firmware = frozen.firmware
            board = firmware.config.index
            actuation = self.twin.answer(firmware, firmware.read(frozen.observation))
            self._say(firmware, actuation.links, deaf=self.noise.quiet)
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
        self.twin.deliver(sender, receiver, payload)
        newcomer = self.newcomers.get(receiver)
        if newcomer is not None and not self.noise.quiet:
            firmware = newcomer.firmware
            firmware.hear(firmware.config.neighbours.index(sender), payload)
