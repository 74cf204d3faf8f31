"""Drives one board with Zenoh.

Everything that the network brings, on whichever thread, is left for the one thread that thinks.
That thread waits for one thing at a time: to be enrolled, for an observation, for the neighbours'
frames of the tick before; then it ticks.
"""

import math
import sys
import time
from queue import Empty
from typing import NoReturn

import zenoh

from module_agent.firmware.board import Actuation, AnsweredError, Board, ReplacedError
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.enrolling import Enrolling, FinishedError
from module_agent.firmware.timing import BoardTiming
from module_agent.process.network import END, MATCHING, REPLY, Event, Post
from module_agent.process.watchdog import Watchdog
from protocol.process.exit_codes import ExitCode
from protocol.process.machine import clock_id, effort
from protocol.robot.scenario import Scenario
from protocol.robot.states import State, entered
from protocol.wire.enrolment import EnrolmentReply
from protocol.wire.frames import End, Observation, ProtocolError, Stalled, decode, encode
from protocol.wire.storms import Refused, Storms
from protocol.wire.wiring import Rig

ASK_EVERY_S = 0.1
"""How often a board that is not ticking yet asks the plant to be let in."""
PLANT_BACK_WITHIN_S = 5.0
STALL_AFTER_S = 0.1
"""A frame that is missing for longer is not merely late: the plant has to decide."""
TELL_AFTER_S = 0.5
"""A wait shorter than this is not worth a line."""
LOOK_AGAIN_S = 20e-6
LOOK_AGAIN_S_MAX = 5e-3
"""How often a board with an observation looks for a neighbour's frame that is not here yet."""


class Runtime:
    """One board process, from its place on the network to the end of the run.

    With `trouble`, no neighbour can reach it: it asks the plant once, to be told why.
    """

    def __init__(
        self,
        post: Post,
        config: BoardConfig,
        scenario: Scenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.trouble = trouble
        self.config = config
        self.rig = rig
        self.enrolling = Enrolling(config, scenario, rig=rig.name)
        self.board: Board | None = None
        self.pending: Observation | None = None
        self.last: Actuation | None = None
        """What was said in the last tick."""
        self.timing = BoardTiming(clock=clock_id())
        self._taken_up_ns = 0
        self._stall_told = False
        self._give_up_s = math.inf
        self._early: bytes | None = None
        self.post = post
        self._waiting_since = time.monotonic()
        self._told = ""
        self._rounds = 0
        self._storms = Storms()
        self._waiting_state = State.BOOT

    @property
    def state(self) -> State:
        """The firmware state, also while there is no board yet."""
        return self._waiting_state if self.board is None else self.board.state

    def move(self, post: Post, trouble: str | None) -> None:
        """Go on from another place on the network."""
        self.post, self.trouble = post, trouble
        self._waiting_since = time.monotonic()

    def run(self) -> NoReturn:
        """Enrol, then tick until the run is over. Raises `FinishedError`, or `UnansweredError`."""
        if self.state is State.BOOT:
            self._waiting_state = entered(self.state, State.ENROLLING)
        self._ask()
        with Watchdog(lambda: self._rounds, self._report_stuck):
            self._loop()

    def _loop(self) -> NoReturn:
        while True:
            self._rounds += 1
            try:
                self._handle(self.post.events.get(timeout=self._patience_s()))
            except Empty:
                self._wait_longer()
            board = self.board
            if board is None:
                continue
            self._hear(board)
            now_s = time.monotonic()
            if now_s > self._storms.due_s:
                self._look_for_storms(board, now_s)
            if self.pending is not None and board.missing(self.pending) is None:
                self._tick(board, self.pending)

    def _patience_s(self) -> float:
        """How long to wait for an event before looking for something else."""
        if self.pending is None:
            return ASK_EVERY_S
        # A neighbour's frame wakes nobody, but is here in no time: look again, ever more rarely.
        waited_s = time.monotonic() - self._waiting_since
        return min(max(LOOK_AGAIN_S, waited_s / 4.0), LOOK_AGAIN_S_MAX)

    def _hear(self, board: Board) -> None:
        for link, payload, arrived_ns in self.post.heard():
            self.timing.arrived(link, board.hear(link, payload), arrived_ns)

    def _tick(self, board: Board, observation: Observation) -> None:
        self.last = board.tick(observation)
        decided_ns = time.monotonic_ns()
        self.post.say(self.last)
        self.timing.ticked(observation.tick, self._taken_up_ns, decided_ns, time.monotonic_ns())
        if self.timing.due:
            self._report_timing()
        if self.last.faults and board.fault is not None:
            self._tell(f"fault {board.fault.code} in tick {observation.tick}\n{board.fault.trace}")
        self.pending = None
        self._stall_told = False
        self._waiting_since = time.monotonic()

    def _report_timing(self) -> None:
        """Tell a plant that records when this board did what; another one need not know."""
        if self.post.records:
            self.post.report_timing(self.timing.frame(effort()))
        else:
            self.timing.ticks.clear()

    def _handle(self, event: "zenoh.Sample | Event") -> None:
        if not isinstance(event, tuple):
            self._observe(event.payload.to_bytes())
            return
        kind, content = event
        if kind == END:
            self._end(content.payload.to_bytes())
        elif kind == REPLY:
            self._take_reply(content)
        elif kind == MATCHING:
            self._ask()
            if self.last is not None:
                # Whoever is back may have missed it; to say it twice is harmless.
                self.post.say(self.last)
        elif content.kind == zenoh.SampleKind.DELETE:
            self._enrol_again(f"the plant is gone; waiting {PLANT_BACK_WITHIN_S:g} s for another")
            self._give_up_s = time.monotonic() + PLANT_BACK_WITHIN_S

    def _observe(self, payload: bytes) -> None:
        board = self.board
        if board is None:
            self._early = payload  # It may overtake the answer that lets this board in.
            return
        try:
            self.pending = board.read(payload)
            self._taken_up_ns = time.monotonic_ns()
            self._stall_told = False
            self._waiting_since = time.monotonic()
        except ProtocolError as error:
            board.refused[error.reason] += 1
        except AnsweredError:
            if self.last is not None:
                self.post.say(self.last)
        except ReplacedError as replaced:
            if replaced.incarnation != 0:
                line = "the plant has given this joint to another process"
                raise FinishedError(ExitCode.REPLACED, line) from None
            self._enrol_again("the plant went on without this board; enrolling again")

    def _enrol_again(self, why: str) -> None:
        """Begin anew: what this board has seen so far means nothing any more."""
        self._tell(why)
        if self.last is not None and self.board is not None:
            self.enrolling.former_run = self.board.run_id
        if self.state is not State.ENROLLING:
            self._waiting_state = entered(self.state, State.ENROLLING)
        self.board = self.pending = self.last = self._early = None
        self.post.forget()
        self._ask()

    def _take_reply(self, reply: zenoh.Reply) -> None:
        """Read the plant's answer to `_ask`; a query that found no plant has none."""
        if reply.ok is None:
            return
        try:
            answer = self.enrolling.answer(reply.ok.payload.to_bytes())
        except ProtocolError as error:
            self._tell(f"cannot read the plant's answer: {error}")
            return
        if self.trouble is not None:
            raise FinishedError(ExitCode.NO_NETWORK, self.trouble)
        self._give_up_s = math.inf
        if self.board is None or self._begins_anew(self.board, answer):
            self.board = self._make_board(answer.run_id, answer.incarnation)
            self.timing.begin(answer.run_id, answer.incarnation)
            if self._early is not None:
                self._observe(self._early)

    def _begins_anew(self, board: Board, answer: EnrolmentReply) -> bool:
        """Whether the plant means another run than the one that this board is in."""
        return self.last is None and board.run_id != answer.run_id

    def _make_board(self, run_id: int, incarnation: int) -> Board:
        return Board(self.config, run_id=run_id, incarnation=incarnation)

    def _end(self, payload: bytes) -> None:
        try:
            end = decode(End, payload)
        except ProtocolError:
            return
        if self.board is not None and end.run_id == self.board.run_id:
            while self.timing.ticks:
                self._report_timing()
            raise FinishedError(ExitCode.OK, f"run over: {end.reason}")

    def _ask(self) -> None:
        """Ask to be let in, or tell the plant that another link has come up."""
        request = self.enrolling.request(
            0 if self.board is None else self.board.incarnation,
            boot=self.post.boot,
            links_up=self.post.links_up(),
            now_s=time.monotonic(),
        )
        self.post.ask(request, ASK_EVERY_S)

    def _wait_longer(self) -> None:
        """Nothing came for a while: ask again if not let in yet, and say once what is missing."""
        ticking = self.board is not None and self.board.next_tick is not None
        if not ticking:
            self._ask()
        if self.board is None and time.monotonic() > self._give_up_s:
            raise FinishedError(ExitCode.PEER_LOST, "the plant did not come back")
        waited_s = time.monotonic() - self._waiting_since
        if self.board is not None and self.pending is not None and waited_s > STALL_AFTER_S:
            self._report_stall(self.board, self.pending)
        if waited_s < TELL_AFTER_S:
            return
        if self.trouble is not None:
            raise FinishedError(ExitCode.NO_NETWORK, self.trouble)
        if self.board is None and self._give_up_s == math.inf:
            where = self.rig.endpoint(0)
            self._tell(f"waiting for the plant of rig {self.rig.name!r} at {where}")
        elif self.board is not None and self.pending is not None:
            link = self.board.missing(self.pending)
            if link is not None:
                sender = self.config.neighbour_joints[link]
                self._tell(f"waiting for {sender}'s frame of tick {self.pending.tick - 1}")
        elif not ticking:
            others = ", ".join(self.post.links_down()) or "the other boards"
            self._tell(f"enrolled; waiting for {others}")

    def _report_stall(self, board: Board, pending: Observation) -> None:
        """Tell the plant whose frame is not there; it decides what to do about it (S6)."""
        link = board.missing(pending)
        if link is not None and not self._stall_told:
            self._stall_told = True
            sender = self.config.neighbours[link]
            report = Stalled(board.run_id, board.incarnation, pending.tick, sender)
            self.post.report_stall(encode(report))

    def _report_stuck(self, where: str) -> None:
        """Say, from another thread, that this board does not come back from something."""
        board, pending = self.board, self.pending
        tick = "" if pending is None else f" in tick {pending.tick}"
        self._tell(f"stuck{tick}, in {where}")
        if board is not None and pending is not None:
            report = Stalled(board.run_id, board.incarnation, pending.tick, self.config.index)
            self.post.report_stall(encode(report))

    def _look_for_storms(self, board: Board, now_s: float) -> None:
        refused: Refused = {
            "observations": board.refused,
            **{
                f"frames of {joint}": hearing.refused
                for joint, hearing in zip(self.config.neighbour_joints, board.hearings, strict=True)
            },
        }
        for storm in self._storms.look(now_s, board.next_tick or 0, refused):
            self._tell(str(storm))

    def _tell(self, line: str) -> None:
        if line != self._told:
            self._told = line
            print(f"{self.config.joint}: {line}", file=sys.stderr, flush=True)
