"""Drives one board with Zenoh in realtime: its loop wakes up by the clock, and by nothing else.

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
from collections.abc import Iterator
from queue import Empty
from typing import Any, NoReturn

import zenoh

from module_agent.firmware.board import AnsweredError, Board, ReplacedError
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.enrolling import FinishedError
from module_agent.firmware.own_time.cycle import Cycle
from module_agent.process.network import Post, publisher
from module_agent.process.runtime import ASK_EVERY_S, Runtime
from module_agent.process.watchdog import Watchdog
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import Scenario
from protocol.robot.states import State, entered
from protocol.wire import keys
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


class RealtimePost(Post):
    """The place of a board that is not woken by what comes."""

    def __init__(self, session: zenoh.Session, config: BoardConfig, *, rig: str, boot: int) -> None:
        self.arrived: deque[tuple[int, zenoh.Sample]] = deque(maxlen=OBSERVATIONS_MAX)
        """Observations, each with its time on the board's own clock, in ns."""
        self._frames: list[deque[zenoh.Sample]] = [
            deque(maxlen=FRAMES_MAX) for _ in config.neighbours
        ]
        self.rate = 1.0 + config.clock.skew_ppm * PPM
        """Of the board's own clock, as its scenario wants it."""
        super().__init__(session, config, rig=rig, boot=boot)
        self._trace = publisher(session, keys.trace(rig, config.joint))

    def now_ns(self) -> int:
        """The time on the board's own clock."""
        return int(time.monotonic_ns() * self.rate)

    def heard(self) -> Iterator[tuple[int, bytes, int]]:
        """What neighbours have said since the last turn; when it arrived does not matter: 0."""
        for link, frames in enumerate(self._frames):
            while frames:
                yield link, frames.popleft().payload.to_bytes(), 0

    def report(self, payload: bytes | None) -> None:
        """Tell the plant what was lived through, if there is a frame of it."""
        if payload is not None:
            self._trace.put(payload)

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        super().forget()
        for frames in self._frames:
            frames.clear()
        self.arrived.clear()

    def _hearing(self, link: int) -> "zenoh.handlers.Callback[zenoh.Sample]":
        return zenoh.handlers.Callback(self._frames[link].append, indirect=False)

    def _observed(self) -> "zenoh.handlers.Callback[zenoh.Sample]":
        def left(sample: zenoh.Sample) -> None:
            self.arrived.append((self.now_ns(), sample))

        return zenoh.handlers.Callback(left, indirect=False)


class RealtimeRuntime(Runtime):
    """One board process in realtime, from its session to the end of the run."""

    def __init__(
        self,
        post: Post,
        config: BoardConfig,
        scenario: Scenario,
        rig: Rig,
        *,
        trouble: str | None = None,
    ) -> None:
        self.cycle: Cycle | None = None
        super().__init__(post, config, scenario, rig, trouble=trouble)
        self._asked_ns = self._observed_ns = self.mail.now_ns()

    @property
    def mail(self) -> RealtimePost:
        """The place on the network, which is not the one of lockstep."""
        assert isinstance(self.post, RealtimePost)
        return self.post

    def run(self) -> NoReturn:
        """Enrol, then turn by turn until the run is over. Raises as `Runtime.run` does."""
        if self.state is State.BOOT:
            self._waiting_state = entered(self.state, State.ENROLLING)
        self._ask()
        gc.freeze()  # What is there now stays: no need to look through it again and again.
        with Watchdog(lambda: self._rounds, self._report_stuck):
            try:
                self._loop()
            finally:
                self._report_rest()

    def _loop(self) -> NoReturn:
        while True:
            self._rounds += 1
            self._wait()
            self._take_in()
            if self.cycle is not None:
                self._turn(self.cycle)

    def _report_rest(self) -> None:
        if self.cycle is not None:
            self.mail.report(self.cycle.rest())

    def _wait(self) -> None:
        """Sleep until the next turn; without a loop, until something happens."""
        next_ns = None if self.cycle is None else self.cycle.next_ns
        if next_ns is None:
            try:
                self._handle(self.post.events.get(timeout=IDLE_S))
            except Empty:
                self._ask_again(self._wait_longer)
            return
        if (wait_ns := next_ns - self.mail.now_ns()) > 0:
            time.sleep(wait_ns * 1e-9 / self.mail.rate)
        if self.mail.now_ns() - self._observed_ns > SILENT_NS:
            self._ask_again(self._ask)

    def _ask_again(self, ask: Any) -> None:
        now_ns = self.mail.now_ns()
        if now_ns - self._asked_ns > ASK_EVERY_S * 1e9:
            self._asked_ns = now_ns
            ask()

    def _take_in(self) -> None:
        """Look at all that has come since the last turn."""
        while not self.post.events.empty():
            self._handle(self.post.events.get())
        cycle = self.cycle
        if cycle is None:
            return
        for link, payload, _ in self.post.heard():
            cycle.board.hear(link, payload)
        while self.mail.arrived:
            arrived_ns, sample = self.mail.arrived.popleft()
            self._observed_ns = arrived_ns
            try:
                cycle.observed(sample.payload.to_bytes(), arrived_ns)
            except ProtocolError as error:
                cycle.board.refused[error.reason] += 1
            except AnsweredError:
                pass
            except ReplacedError:
                line = "the plant has given this joint to another process"
                raise FinishedError(ExitCode.REPLACED, line) from None

    def _turn(self, cycle: Cycle) -> None:
        started_ns = time.thread_time_ns()
        turn = cycle.wake(self.mail.now_ns())
        if turn is None:
            return
        for slot in turn.slots:
            self.last = cycle.board.play(slot)
            self.post.say(self.last)
            self.mail.report(cycle.said(slot, self.mail.now_ns()))
        for word in cycle.last_words():
            self.mail.report(word)
        line = cycle.turned(self.mail.now_ns(), time.thread_time_ns() - started_ns)
        if line is not None:
            self._tell(line)
        now_s = time.monotonic()
        if now_s > self._storms.due_s:
            self._look_for_storms(cycle.board, now_s)

    def _enrol_again(self, why: str) -> None:
        self._report_rest()
        self.cycle = None
        super()._enrol_again(why)

    def _begins_anew(self, board: Board, answer: EnrolmentReply) -> bool:
        """Also a board that the plant has given up begins anew: it waits for nobody's word."""
        return (board.run_id, board.incarnation) != (answer.run_id, answer.incarnation)

    def _make_board(self, run_id: int, incarnation: int) -> Board:
        if self.cycle is not None:
            self._report_rest()
            self._tell("the plant went on without this board; beginning anew")
        self.cycle = Cycle(
            self.config,
            tick_ns=round(self.config.tick_s * 1e9),
            run_id=run_id,
            incarnation=incarnation,
        )
        return self.cycle.board
