"""A board's membership in a run: it asks to be let in, hears of the end, and begins anew.

What a board does in between is up to a loop (`MemberLoop`): one that waits for each tick's
observation, or one that wakes up by its own clock.
"""

import math
import sys
import time
from typing import Protocol

import zenoh

from module_agent.firmware.board import Actuation, Board
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.enrolling import Enrolling, FinishedError
from module_agent.process.network import END, MATCHING, REPLY, BoardNetwork, Event
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import Scenario
from protocol.robot.states import State, entered
from protocol.wire.enrolment import EnrolmentReply
from protocol.wire.frames import End, Observation, ProtocolError, StallReport, decode, encode
from protocol.wire.storms import Refused, Storms
from protocol.wire.wiring import Rig

ASK_EVERY_S = 0.1
"""How often a board that is not ticking yet asks the plant to be let in."""
PLANT_BACK_WITHIN_S = 5.0
TELL_AFTER_S = 0.5
"""A wait shorter than this is not worth a line."""


class MemberLoop(Protocol):
    """What drives a board while it is a member."""

    def begins_anew(self, board: Board, answer: EnrolmentReply) -> bool:
        """Whether the plant means another part in a run than the one that this board plays."""
        ...

    def make_board(self, run_id: int, incarnation: int) -> Board:
        """Make the board that has been let in."""
        ...

    def begin(self, board: Board) -> None:
        """Take up what has come already for the board that was made."""
        ...

    def leave(self) -> None:
        """Forget all that was seen: the board is to begin anew."""
        ...

    def end(self) -> None:
        """Tell what has not been told yet: the run is over."""
        ...


class Membership:
    """One board process as the plant knows it, from its place on the network to the end of the run.

    With `trouble`, no neighbour can reach it: it asks the plant once, to be told why.
    """

    def __init__(
        self,
        loop: MemberLoop,
        network: BoardNetwork,
        config: BoardConfig,
        scenario: Scenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.loop = loop
        self.network = network
        self.config = config
        self.rig = rig
        self.trouble = trouble
        self.enrolling = Enrolling(config, scenario, rig=rig.name)
        self.board: Board | None = None
        self.last: Actuation | None = None
        """What was said in the last tick."""
        self.waiting_since_s = time.monotonic()
        self._give_up_s = math.inf
        self._last_line = ""
        self.storms = Storms()
        self._waiting_state = State.BOOT

    @property
    def state(self) -> State:
        """The firmware state, also while there is no board yet."""
        return self._waiting_state if self.board is None else self.board.state

    @property
    def ticking(self) -> bool:
        """Whether the board has begun."""
        return self.board is not None and self.board.next_tick is not None

    def move(self, network: BoardNetwork, trouble: str | None) -> None:
        """Go on from another place on the network."""
        self.network, self.trouble = network, trouble
        self.waiting_since_s = time.monotonic()

    def enrol(self) -> None:
        """Ask to be let in for the first time."""
        if self.state is State.BOOT:
            self._waiting_state = entered(self.state, State.ENROLLING)
        self.ask()

    def ask(self) -> None:
        """Ask to be let in, or tell the plant that another link has come up.

        Raises `UnansweredError` when there has been no answer for long.
        """
        request = self.enrolling.request(
            0 if self.board is None else self.board.incarnation,
            boot=self.network.boot,
            links_up=self.network.links_up(),
            now_s=time.monotonic(),
        )
        self.network.ask(request, ASK_EVERY_S)

    def say(self, actuation: Actuation) -> None:
        """Send what a tick says."""
        self.last = actuation
        self.network.say(actuation)

    def say_again(self) -> None:
        """Whoever is back may have missed it; to say it twice is harmless."""
        if self.last is not None:
            self.network.say(self.last)

    def handle(self, event: Event) -> None:
        """Take what the network brings besides observations and link frames."""
        kind, content = event
        if kind == END:
            self._end(content.payload.to_bytes())
        elif kind == REPLY:
            self._take_reply(content)
        elif kind == MATCHING:
            self.ask()
            self.say_again()
        elif content.kind == zenoh.SampleKind.DELETE:
            self.enrol_again(f"the plant is gone; waiting {PLANT_BACK_WITHIN_S:g} s for another")
            self._give_up_s = time.monotonic() + PLANT_BACK_WITHIN_S

    def enrol_again(self, why: str) -> None:
        """Begin anew: what this board has seen so far means nothing any more."""
        self.tell(why)
        if self.last is not None and self.board is not None:
            self.enrolling.former_run = self.board.run_id
        if self.state is not State.ENROLLING:
            self._waiting_state = entered(self.state, State.ENROLLING)
        self.loop.leave()
        self.board = self.last = None
        self.network.forget()
        self.ask()

    def waited(self) -> None:
        """Nothing came for a while: ask again if not let in yet, and say once what is missing."""
        if not self.ticking:
            self.ask()
        now_s = time.monotonic()
        if self.board is None and now_s > self._give_up_s:
            raise FinishedError(ExitCode.PEER_LOST, "the plant did not come back")
        if now_s - self.waiting_since_s < TELL_AFTER_S:
            return
        if self.trouble is not None:
            raise FinishedError(ExitCode.NO_NETWORK, self.trouble)
        if self.board is None and self._give_up_s == math.inf:
            where = self.rig.endpoint(0)
            self.tell(f"waiting for the plant of rig {self.rig.name!r} at {where}")
        elif not self.ticking:
            others = ", ".join(self.network.links_down()) or "the other boards"
            self.tell(f"enrolled; waiting for {others}")

    def report_stall(self, board: Board, tick: int, sender: int) -> None:
        """Tell the plant whose frame is not there; it decides what to do about it (S6)."""
        self.network.report_stall(
            encode(StallReport(board.run_id, board.incarnation, tick, sender))
        )

    def report_stuck(self, where: str, pending: Observation | None) -> None:
        """Say, from another thread, that this board does not come back from something."""
        board = self.board
        tick = "" if pending is None else f" in tick {pending.tick}"
        self.tell(f"stuck{tick}, in {where}")
        if board is not None and pending is not None:
            self.report_stall(board, pending.tick, self.config.index)

    def look_for_storms(self, board: Board, now_s: float) -> None:
        """Name, seldom, what brings frames by the thousand that are of no use."""
        refused: Refused = {
            "observations": board.refused,
            **{
                f"frames of {joint}": link.refused
                for joint, link in zip(self.config.neighbour_joints, board.hearings, strict=True)
            },
        }
        for storm in self.storms.look(now_s, board.next_tick or 0, refused):
            self.tell(str(storm))

    def tell(self, line: str) -> None:
        """Say a line to the user, once."""
        if line != self._last_line:
            self._last_line = line
            print(f"{self.config.joint}: {line}", file=sys.stderr, flush=True)

    def _take_reply(self, reply: zenoh.Reply) -> None:
        """Read the plant's answer to `ask`; a query that found no plant has none."""
        if reply.ok is None:
            return
        try:
            answer = self.enrolling.answer(reply.ok.payload.to_bytes())
        except ProtocolError as error:
            self.tell(f"cannot read the plant's answer: {error}")
            return
        if self.trouble is not None:
            raise FinishedError(ExitCode.NO_NETWORK, self.trouble)
        self._give_up_s = math.inf
        if self.board is None or self.loop.begins_anew(self.board, answer):
            self.board = self.loop.make_board(answer.run_id, answer.incarnation)
            self.loop.begin(self.board)

    def _end(self, payload: bytes) -> None:
        try:
            end = decode(End, payload)
        except ProtocolError:
            return
        if self.board is not None and end.run_id == self.board.run_id:
            self.loop.end()
            raise FinishedError(ExitCode.OK, f"run over: {end.reason}")
