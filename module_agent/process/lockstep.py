"""Drives one board with Zenoh in lockstep.

Everything that the network brings, on whichever thread, is left for the one thread that thinks.
That thread waits for one thing at a time: to be enrolled, for an observation, for the neighbours'
frames of the tick before; then it ticks.
"""

import time
from queue import Empty
from typing import NoReturn

from module_agent.assembly import assemble
from module_agent.firmware.board import AnsweredError, Board, ReplacedError
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.enrolling import FinishedError
from module_agent.firmware.timing import BoardTiming
from module_agent.process.membership import ASK_EVERY_S, TELL_AFTER_S, Membership
from module_agent.process.network import BoardNetwork, LockstepInbox
from module_agent.process.watchdog import Watchdog
from protocol.process.exit_codes import ExitCode
from protocol.process.machine import EffortMeter, clock_id
from protocol.robot.scenario import Scenario
from protocol.wire.enrolment import EnrolmentReply
from protocol.wire.frames import Observation, ProtocolError
from protocol.wire.timing import Timing
from protocol.wire.wiring import Rig

STALL_AFTER_S = 0.1
"""A frame that is missing for longer is not merely late: the plant has to decide."""
LOOK_AGAIN_S = 20e-6
LOOK_AGAIN_S_MAX = 5e-3
"""How often a board with an observation looks for a neighbour's frame that is not here yet."""


class BoardLockstepLoop:
    """One board process, from its place on the network to the end of the run."""

    def __init__(
        self,
        network: BoardNetwork,
        inbox: LockstepInbox,
        config: BoardConfig,
        scenario: Scenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.config = config
        self.inbox = inbox
        self.member = Membership(self, network, config, scenario, rig, trouble=trouble)
        self.pending: Observation | None = None
        self.timing = BoardTiming(clock=clock_id())
        self.effort = EffortMeter()
        self._taken_up_ns = 0
        self._stall_told = False
        self._early: bytes | None = None
        self._rounds = 0

    def move(self, network: BoardNetwork, inbox: LockstepInbox, trouble: str | None) -> None:
        """Go on from another place on the network."""
        self.inbox = inbox
        self.member.move(network, trouble)

    def run(self) -> NoReturn:
        """Enrol, then tick until the run is over. Raises `FinishedError`, or `UnansweredError`."""
        self.member.enrol()
        with Watchdog(lambda: self._rounds, self._report_stuck):
            self._loop()

    def begins_anew(self, board: Board, answer: EnrolmentReply) -> bool:
        """Whether the plant means another run than the one that this board is in."""
        return self.member.last is None and board.run_id != answer.run_id

    def make_board(self, run_id: int, incarnation: int) -> Board:
        """Make the board that has been let in."""
        self.timing.begin(run_id, incarnation)
        return assemble(self.config, run_id=run_id, incarnation=incarnation)

    def begin(self, board: Board) -> None:
        """Take up an observation that has overtaken the answer to the enrolment."""
        if self._early is not None:
            self._observe(board, self._early)

    def leave(self) -> None:
        """Forget what this board was about to do."""
        self.pending = self._early = None

    def end(self) -> None:
        """Tell the rest of when this board did what."""
        while self.timing.ticks:
            self._report_timing()

    def _loop(self) -> NoReturn:
        member = self.member
        while True:
            self._rounds += 1
            try:
                event = self.inbox.events.get(timeout=self._patience_s())
            except Empty:
                self._wait_longer()
            else:
                if isinstance(event, tuple):
                    member.handle(event)
                else:
                    self._arrived(event.payload.to_bytes())
            board = member.board
            if board is None:
                continue
            for link, payload, arrived_ns in self.inbox.heard():
                self.timing.arrived(link, board.hear(link, payload), arrived_ns)
            now_s = time.monotonic()
            if now_s > member.storms.due_s:
                member.look_for_storms(board, now_s)
            if self.pending is not None and board.missing(self.pending) is None:
                self._tick(board, self.pending)

    def _patience_s(self) -> float:
        """How long to wait for an event before looking for something else."""
        if self.pending is None:
            return ASK_EVERY_S
        # A neighbour's frame wakes nobody, but is here in no time: look again, ever more rarely.
        waited_s = time.monotonic() - self.member.waiting_since_s
        return min(max(LOOK_AGAIN_S, waited_s / 4.0), LOOK_AGAIN_S_MAX)

    def _tick(self, board: Board, observation: Observation) -> None:
        actuation = board.tick(observation)
        decided_ns = time.monotonic_ns()
        self.member.say(actuation)
        self.timing.ticked(observation.tick, self._taken_up_ns, decided_ns, time.monotonic_ns())
        if self.timing.due:
            self._report_timing()
        if actuation.faults and board.fault is not None:
            fault = board.fault
            self.member.tell(f"fault {fault.code} in tick {observation.tick}\n{fault.trace}")
        self.pending = None
        self._stall_told = False
        self.member.waiting_since_s = time.monotonic()

    def _report_timing(self) -> None:
        """Tell a plant that records when this board did what; another one need not know."""
        network = self.member.network
        if network.records:
            network.report(Timing, self.timing.frame(self.effort.read()))
        else:
            self.timing.ticks.clear()

    def _arrived(self, payload: bytes) -> None:
        if self.member.board is None:
            self._early = payload  # It may overtake the answer that lets this board in.
        else:
            self._observe(self.member.board, payload)

    def _observe(self, board: Board, payload: bytes) -> None:
        try:
            self.pending = board.read(payload)
        except ProtocolError as error:
            board.refused[error.reason] += 1
        except AnsweredError:
            self.member.say_again()
        except ReplacedError as replaced:
            if replaced.incarnation != 0:
                line = "the plant has given this joint to another process"
                raise FinishedError(ExitCode.REPLACED, line) from None
            self.member.enrol_again("the plant went on without this board; enrolling again")
        else:
            self._taken_up_ns = time.monotonic_ns()
            self._stall_told = False
            self.member.waiting_since_s = time.monotonic()

    def _wait_longer(self) -> None:
        """Nothing came for a while: say once, and tell the plant, whose frame is missing."""
        member, pending = self.member, self.pending
        board = member.board
        if board is None or pending is None:
            member.waited()
            return
        if not member.ticking:
            member.ask()
        waited_s = time.monotonic() - member.waiting_since_s
        link = board.missing(pending)
        if link is None:
            return
        if waited_s > STALL_AFTER_S and not self._stall_told:
            self._stall_told = True
            member.report_stall(board, pending.tick, self.config.neighbours[link])
        if waited_s > TELL_AFTER_S:
            sender = self.config.neighbour_joints[link]
            member.tell(f"waiting for {sender}'s frame of tick {pending.tick - 1}")

    def _report_stuck(self, where: str) -> None:
        self.member.report_stuck(where, self.pending)
