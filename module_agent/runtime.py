"""Drives one board with Zenoh.

Everything that the network brings, on whichever thread, is left for the one thread that thinks.
That thread waits for one thing at a time: to be enrolled, for an observation, for the neighbours'
frames of the tick before; then it ticks.
"""

import math
import os
import sys
import time
from queue import Empty
from typing import NamedTuple, NoReturn

import zenoh

from module_agent.board import Actuation, AnsweredError, Board, ReplacedError
from module_agent.config import BoardConfig
from module_agent.post import END, MATCHING, REPLY, Event, Post
from protocol.enrolment import EnrolmentRequest, Verdict, decode_reply, encode_enrolment
from protocol.exit_codes import ExitCode, refused
from protocol.frames import (
    VERSION,
    End,
    Observation,
    ProtocolError,
    Stalled,
    decode,
    encode,
)
from protocol.scenario import ResolvedScenario
from protocol.wiring import Rig

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


class Spoken(NamedTuple):
    """What a board said in one tick."""

    tick: int
    actuation: Actuation


class FinishedError(Exception):
    """This board's part is over; says how, as an exit code and a line for the user."""

    def __init__(self, code: int, line: str) -> None:
        super().__init__(line)
        self.code = code


class Runtime:
    """One board process, from its session to the end of the run.

    With `trouble`, no neighbour can reach it: it asks the plant once, to be told why.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: BoardConfig,
        scenario: ResolvedScenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.trouble = trouble
        self.config = config
        self.scenario = scenario
        self.rig = rig
        self.boot = int.from_bytes(os.urandom(8), "little") >> 1
        self.board: Board | None = None
        self.pending: Observation | None = None
        self.last: Spoken | None = None
        """What was said in the last tick."""
        self._stall_told = False
        self._give_up_s = math.inf
        self._early: bytes | None = None
        self.post = self._make_post(session)
        self._waiting_since = time.monotonic()
        self._told = ""

    def _make_post(self, session: zenoh.Session) -> Post:
        return Post(session, self.config, rig=self.rig.name, boot=self.boot)

    def _make_board(self, run_id: int, incarnation: int) -> Board:
        return Board(self.config, run_id=run_id, incarnation=incarnation)

    def run(self) -> NoReturn:
        """Enrol, then tick until the run is over. Raises `FinishedError`."""
        self._ask()
        while True:
            try:
                self._handle(self.post.events.get(timeout=self._patience_s()))
            except Empty:
                self._wait_longer()
            board = self.board
            if board is None:
                continue
            self._hear(board)
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
        for link, frames in enumerate(self.post.heard):
            while frames:
                board.hear(link, frames.popleft().payload.to_bytes())

    def _tick(self, board: Board, observation: Observation) -> None:
        self.last = Spoken(observation.tick, board.tick(observation))
        self.post.say(self.last.actuation)
        self.pending = None
        self._stall_told = False
        self._waiting_since = time.monotonic()

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
                self.post.say(self.last.actuation)
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
            self._stall_told = False
            self._waiting_since = time.monotonic()
        except ProtocolError as error:
            board.refused[error.reason] += 1
        except AnsweredError:
            if self.last is not None:
                self.post.say(self.last.actuation)
        except ReplacedError as replaced:
            if replaced.incarnation != 0:
                line = "the plant has given this joint to another process"
                raise FinishedError(ExitCode.REPLACED, line) from None
            self._enrol_again("the plant went on without this board; enrolling again")

    def _enrol_again(self, why: str) -> None:
        """Begin anew: what this board has seen so far means nothing any more."""
        self._tell(why)
        self.board = self.pending = self.last = self._early = None
        self.post.forget()
        self._ask()

    def _take_reply(self, reply: zenoh.Reply) -> None:
        """Read the plant's answer to `_ask`; a query that found no plant has none."""
        if reply.ok is None:
            return
        try:
            answer = decode_reply(reply.ok.payload.to_bytes())
        except ProtocolError as error:
            self._tell(f"cannot read the plant's answer: {error}")
            return
        if answer.verdict != Verdict.ACCEPTED:
            raise FinishedError(refused(answer.verdict), f"refused: {answer.reason}")
        if self.trouble is not None:
            raise FinishedError(ExitCode.NO_NETWORK, self.trouble)
        self._give_up_s = math.inf
        if self.board is None or self.board.incarnation != answer.incarnation:
            self.board = self._make_board(answer.run_id, answer.incarnation)
            if self._early is not None:
                self._observe(self._early)

    def _end(self, payload: bytes) -> None:
        try:
            end = decode(End, payload)
        except ProtocolError:
            return
        if self.board is not None and end.run_id == self.board.run_id:
            raise FinishedError(ExitCode.OK, f"run over: {end.reason}")

    def _ask(self) -> None:
        """Ask to be let in, or tell the plant that another link has come up."""
        link = self.config.link
        request = EnrolmentRequest(
            version=VERSION,
            rig=self.rig.name,
            joint=self.config.joint,
            incarnation=0 if self.board is None else self.board.incarnation,
            scenario_digest=self.scenario.digest,
            boot=self.boot,
            links_up=sum(up << n for n, up in enumerate(self.post.links_up())),
            mass_kg=link.mass_kg,
            length_m=link.length_m,
            com_m=link.com_m,
            inertia_kg_m2=link.inertia_kg_m2,
        )
        self.post.ask(encode_enrolment(request), ASK_EVERY_S)

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
            down = [
                joint
                for joint, up in zip(
                    self.config.neighbour_joints, self.post.links_up(), strict=True
                )
                if not up
            ]
            self._tell(f"enrolled; waiting for {', '.join(down) or 'the other boards'}")

    def _report_stall(self, board: Board, pending: Observation) -> None:
        """Tell the plant whose frame is not there; it decides what to do about it (S6)."""
        link = board.missing(pending)
        if link is not None and not self._stall_told:
            self._stall_told = True
            sender = self.config.neighbours[link]
            report = Stalled(board.run_id, board.incarnation, pending.tick, sender)
            self.post.report_stall(encode(report))

    def _tell(self, line: str) -> None:
        if line != self._told:
            self._told = line
            print(f"{self.config.joint}: {line}", file=sys.stderr, flush=True)
