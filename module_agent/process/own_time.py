"""Drives one board with Zenoh on its own clock: its loop wakes up by that, and by nothing else.

Rule 1: between two turns this thread sleeps. What the network brings is left for the next turn:
        observations with the time at which they came, frames of neighbours in a bounded queue.
Rule 2: what a turn says goes out before anything else is done: accounts, traces, complaints.
Rule 3: a board that hears nothing of the plant for a while goes on by itself, and asks whether it
        is still in. If the plant has given it up, it begins anew.

The sleep ends about 0.1 ms late, which is in the account. To spin for the rest would take a core
from the others: four processes share two.
"""

import gc
import time
from collections import deque
from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue
from typing import NoReturn

import zenoh

from module_agent.assembly import assemble_on_own_time
from module_agent.firmware.board import AnsweredError, Board, ReplacedError
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.enrolling import FinishedError
from module_agent.firmware.own_time.cycle import Cycle
from module_agent.process.membership import ASK_EVERY_S, Membership
from module_agent.process.network import BoardNetwork, Event
from module_agent.process.watchdog import Watchdog
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import Scenario
from protocol.wire.enrolment import EnrolmentReply
from protocol.wire.frames import ProtocolError
from protocol.wire.wiring import Rig

IDLE_S = 0.005
"""How often a board that has no loop yet looks for its first observation."""
SILENT_NS = 1_000_000_000
"""After so long without an observation a board asks whether it is still in."""
OBSERVATIONS_MAX = 1024
PPM = 1e-6
FRAMES_MAX = 16
"""Per link and turn: more is a storm, and the newest count."""


class OwnTimeInbox:
    """An inbox that wakes nobody, and has the board's own clock."""

    def __init__(self, config: BoardConfig) -> None:
        self.events: SimpleQueue[zenoh.Sample | Event] = SimpleQueue()
        self.arrived: deque[tuple[int, zenoh.Sample]] = deque(maxlen=OBSERVATIONS_MAX)
        """Observations, each with its time on the board's own clock, in ns."""
        self.rate = 1.0 + config.clock.skew_ppm * PPM
        """Of the board's own clock, as its scenario wants it."""
        self._frames: list[deque[zenoh.Sample]] = [
            deque(maxlen=FRAMES_MAX) for _ in config.neighbours
        ]

    def now_ns(self) -> int:
        """The time on the board's own clock."""
        return int(time.monotonic_ns() * self.rate)

    def observation_handler(self) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves an observation, with its time of arrival."""

        def left(sample: zenoh.Sample) -> None:
            self.arrived.append((self.now_ns(), sample))

        return zenoh.handlers.Callback(left, indirect=False)

    def frame_handler(self, link: int) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves a frame of a neighbour; when it arrived does not matter."""
        return zenoh.handlers.Callback(self._frames[link].append, indirect=False)

    def heard(self) -> Iterator[tuple[int, bytes]]:
        """What neighbours have said since the last turn: link, frame."""
        for link, frames in enumerate(self._frames):
            while frames:
                yield link, frames.popleft().payload.to_bytes()

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        while not self.events.empty():
            self.events.get()
        for frames in self._frames:
            frames.clear()
        self.arrived.clear()


class BoardOwnTimeLoop:
    """One board process in realtime, from its place on the network to the end of the run."""

    def __init__(
        self,
        network: BoardNetwork,
        inbox: OwnTimeInbox,
        config: BoardConfig,
        scenario: Scenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.config = config
        self.inbox = inbox
        self.member = Membership(self, network, config, scenario, rig, trouble=trouble)
        self.cycle: Cycle | None = None
        self._asked_ns = self._observed_ns = inbox.now_ns()
        self._rounds = 0

    def move(self, network: BoardNetwork, inbox: OwnTimeInbox, trouble: str | None) -> None:
        """Go on from another place on the network."""
        self.inbox = inbox
        self.member.move(network, trouble)

    def run(self) -> NoReturn:
        """Enrol, then turn by turn until the run is over. Raises as `LockstepLoop.run` does."""
        self.member.enrol()
        gc.freeze()  # What is there now stays: no need to look through it again and again.
        with Watchdog(lambda: self._rounds, self._report_stuck):
            try:
                self._loop()
            finally:
                self._report_rest()

    def begins_anew(self, board: Board, answer: EnrolmentReply) -> bool:
        """Also a board that the plant has given up begins anew: it waits for nobody's word."""
        return (board.run_id, board.incarnation) != (answer.run_id, answer.incarnation)

    def make_board(self, run_id: int, incarnation: int) -> Board:
        """Make the board that has been let in, and its loop."""
        if self.cycle is not None:
            self._report_rest()
            self.member.tell("the plant went on without this board; beginning anew")
        board = assemble_on_own_time(self.config, run_id=run_id, incarnation=incarnation)
        self.cycle = Cycle(board, self.config)
        return self.cycle.board.board

    def begin(self, board: Board) -> None:
        """Nothing was left over: observations are looked at turn by turn."""

    def leave(self) -> None:
        """Tell the rest of what was played, and forget the loop."""
        self._report_rest()
        self.cycle = None

    def end(self) -> None:
        """The rest is told on the way out."""

    def _loop(self) -> NoReturn:
        while True:
            self._rounds += 1
            self._wait()
            self._take_in()
            if self.cycle is not None:
                self._turn(self.cycle)

    def _report_rest(self) -> None:
        if self.cycle is not None:
            self.member.network.report_trace(self.cycle.rest())

    def _wait(self) -> None:
        """Sleep until the next turn; without a loop, until something happens."""
        next_ns = None if self.cycle is None else self.cycle.next_ns
        if next_ns is None:
            try:
                self._handle(self.inbox.events.get(timeout=IDLE_S))
            except Empty:
                self._ask_again(self.member.waited)
            return
        if (wait_ns := next_ns - self.inbox.now_ns()) > 0:
            time.sleep(wait_ns * 1e-9 / self.inbox.rate)
        if self.inbox.now_ns() - self._observed_ns > SILENT_NS:
            self._ask_again(self.member.ask)

    def _ask_again(self, ask: Callable[[], None]) -> None:
        now_ns = self.inbox.now_ns()
        if now_ns - self._asked_ns > ASK_EVERY_S * 1e9:
            self._asked_ns = now_ns
            ask()

    def _handle(self, event: "zenoh.Sample | Event") -> None:
        assert isinstance(event, tuple), "observations are left elsewhere"
        self.member.handle(event)

    def _take_in(self) -> None:
        """Look at all that has come since the last turn."""
        while not self.inbox.events.empty():
            self._handle(self.inbox.events.get())
        cycle = self.cycle
        if cycle is None:
            return
        for link, payload in self.inbox.heard():
            cycle.board.hear(link, payload)
        while self.inbox.arrived:
            arrived_ns, sample = self.inbox.arrived.popleft()
            self._observed_ns = arrived_ns
            try:
                cycle.observed(sample.payload.to_bytes(), arrived_ns)
            except ProtocolError as error:
                cycle.board.board.refused[error.reason] += 1
            except AnsweredError:
                pass
            except ReplacedError:
                line = "the plant has given this joint to another process"
                raise FinishedError(ExitCode.REPLACED, line) from None

    def _turn(self, cycle: Cycle) -> None:
        started_ns = time.thread_time_ns()
        turn = cycle.wake(self.inbox.now_ns())
        if turn is None:
            return
        member = self.member
        for slot in turn.slots:
            member.say(cycle.board.play(slot))
            member.network.report_trace(cycle.said(slot, self.inbox.now_ns()))
        for word in cycle.last_words():
            member.network.report_trace(word)
        line = cycle.turned(self.inbox.now_ns(), time.thread_time_ns() - started_ns)
        if line is not None:
            member.tell(line)
        now_s = time.monotonic()
        if now_s > member.storms.due_s:
            member.look_for_storms(cycle.board.board, now_s)

    def _report_stuck(self, where: str) -> None:
        self.member.report_stuck(where, None)
