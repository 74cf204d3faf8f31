"""Drives the plant with Zenoh: lets boards in, then opens and closes ticks until the run is over.

Everything that the network brings, on whichever thread, goes through one queue to the one thread
that thinks.
"""

import time
from contextlib import suppress
from queue import Empty

import zenoh

from plant_server.process.console import Voice
from plant_server.process.network import CONTROL, ENROL, FAULT, STALLED, Event, Post
from plant_server.process.options import Options
from plant_server.record import STOPPED, Outcome, Walls
from plant_server.session import control
from plant_server.session.config import PlantConfig, plant_config
from plant_server.session.enrolment import Enrolment
from plant_server.session.lockstep import Lockstep
from plant_server.session.watch import ENROLMENT_REQUESTS, Watch
from plant_server.spool.recorder import Recorder
from plant_server.spool.spool import SpoolWriter
from protocol.process.stopping import StoppedError, undisturbed
from protocol.robot.events import Plug, Unplug
from protocol.robot.scenario import Scenario
from protocol.wire import keys
from protocol.wire.enrolment import Verdict, decode_request, encode_enrolment
from protocol.wire.frames import End, ProtocolError, Stalled, decode, encode, shortened
from protocol.wire.wiring import Rig, neighbours

TELL_AFTER_S = 0.5
"""A wait shorter than this is not worth a line."""
STALL_AFTER_S = 1.0
LOOK_EVERY_S = 0.02
FAREWELL_S = 5.0
"""How long the plant waits for boards to have heard that the run is over."""
HURRIED_S = 0.5
"""The same when it was stopped: a board may be frozen, and somebody is waiting for the end."""


class Runtime:
    """One plant process, from its place on the network to the end of the run."""

    def __init__(
        self,
        post: Post,
        scenario: Scenario,
        rig: Rig,
        options: Options,
        writer: SpoolWriter | None,
    ) -> None:
        self.rig = rig
        self.options = options
        self.joints = scenario.joints
        self.enrolment = Enrolment(rig=rig.name, joints=self.joints, digest=scenario.digest)
        self.lockstep = self._make_plant(plant_config(scenario))
        self.recorder = None if writer is None else Recorder(writer, self.enrolment)
        self.post = post
        self._released_s: float | None = None
        self.voice = Voice(launcher=options.progress)
        self._say, self._tell = self.voice.say, self.voice.tell
        self.watch = Watch(self.joints)
        self._unplugging: int | None = None
        self._ending = False
        self._newcomers: set[int] = set()
        self._starved: dict[int, int] = {}
        """Boards that say whose frame they wait for."""
        self._answered_ns = [0] * len(self.joints)

    def _make_plant(self, config: PlantConfig) -> Lockstep:
        return Lockstep(config, run_id=self.enrolment.run_id)

    def run(self) -> Outcome:
        """Wait for every board, then tick to the end. Returns how the run ended."""
        try:
            while not all(map(self._connected, range(len(self.joints)))):
                for board in range(len(self.joints)):
                    self._wait_for(board)
            self.enrolment.begun = True
            self.lockstep.run_id = self.enrolment.run_id
            for board in range(len(self.joints)):
                self._admit(board)
        except StoppedError:
            self._farewell(STOPPED)
            raise
        cut_short = None
        try:
            while not self.lockstep.over:
                self._boundary()
                self._tick()
        except StoppedError:
            cut_short = STOPPED
        wall_s = 0.0 if self._released_s is None else time.monotonic() - self._released_s
        outcome = self.lockstep.outcome(wall_s, cut_short)
        self._conclude(outcome)
        return outcome

    def _conclude(self, outcome: Outcome) -> None:
        """Tell everybody that the run is over, hear their last words, and close the recording."""
        self._say(f"{outcome.tick} {outcome.wall_s:.6f}")
        try:
            self._farewell(outcome.ending)
        finally:
            if self.recorder is not None:
                self.recorder.close(outcome, self.post.reports())

    def _boundary(self) -> None:
        """Between two ticks: boards come and go."""
        match self.lockstep.begin():
            case Unplug(board) if self.lockstep.roster.present(board):
                self._unplug(board)
            case Plug(board) if not self.lockstep.roster.present(board):
                self._say(f"start {self.joints[board]}")
                self._wait_for(board)
                self._admit(board)
        for board in sorted(self._newcomers):
            if self._connected(board) and not self.lockstep.agenda.expects_plug(board):
                self._admit(board)

    def _admit(self, board: int) -> None:
        self._newcomers.discard(board)
        self.lockstep.admit(board, self.enrolment.seats[board].incarnation)

    def _unplug(self, board: int) -> None:
        """Have the launcher end the board's process, and wait until it is gone."""
        joint = self.joints[board]
        self._unplugging = board
        self._say(f"kill {joint}")
        started = time.monotonic()
        while self.lockstep.roster.present(board):
            with suppress(Empty):
                self._handle(self.post.events.get(timeout=LOOK_EVERY_S))
            if time.monotonic() - started > TELL_AFTER_S:
                self._tell(f"waiting for {joint} to be unplugged: end its process")

    def _wait_for(self, board: int) -> None:
        """Let boards in until this one is here, and hears and is heard."""
        started = time.monotonic()
        while not self._connected(board):
            with suppress(Empty):
                self._handle(self.post.events.get(timeout=LOOK_EVERY_S))
            if time.monotonic() - started > TELL_AFTER_S:
                links = f"the links of {self.joints[board]}"
                self._tell(f"waiting for {', '.join(self.enrolment.absent) or links}")

    def _connected(self, board: int) -> bool:
        return self.enrolment.linked(board) and self.post.reaches(board)

    def _tick(self) -> None:
        lockstep = self.lockstep
        if lockstep.tick == 0:
            self._released_s = time.monotonic()
        self._answered_ns = [0] * len(self.joints)
        opened_ns = time.monotonic_ns()
        for board, payload in lockstep.open():
            self.post.observe(board, payload)
        if self.recorder is not None:
            self.recorder.write(self.post.reports())
        patience_s = self.options.patience_s or STALL_AFTER_S
        while lockstep.waiting:
            try:
                self._handle(self.post.events.get(timeout=patience_s))
            except Empty:
                self._lose_patience()
            now = time.monotonic()
            if now > self.watch.storms.due_s:
                self.watch.tell_storms(now, lockstep, self._tell)
        self._starved.clear()
        walls = Walls(opened_ns, tuple(self._answered_ns), time.monotonic_ns())
        with undisturbed:  # A body that is half way to the next tick is no ending.
            record = lockstep.close()
            if self.recorder is not None:
                self.recorder.keep(record, walls)
        self.voice.show(record.tick, self._released_s)

    def _lose_patience(self) -> None:
        """Nothing came for a while: say who is waited for; without endless patience, go on."""
        lockstep = self.lockstep
        slow = lockstep.waiting_for
        self._tell(f"tick {lockstep.tick} waits for {', '.join(self.joints[i] for i in slow)}")
        for board in slow:
            if board in self._starved:
                if self.options.patience_s is not None:
                    self._excuse(board)
            elif self.options.patience_s is None:
                self.post.observe(board, lockstep.observation(board))
            else:
                self._dismiss(board)

    def _excuse(self, board: int) -> None:
        """Let a board go on without the frame that it waits for."""
        sender = self._starved.pop(board)
        self.post.observe(board, self.lockstep.excuse(sender, board))

    def _excuse_orphans(self) -> None:
        """Let boards go on whose missing frame will never come, because its sender is gone."""
        for board, sender in list(self._starved.items()):
            if not self.lockstep.roster.present(sender):
                self._excuse(board)

    def _dismiss(self, board: int) -> None:
        """Give up on a silent board; should it wake up, it learns so, and may enrol again."""
        self.enrolment.dismiss(board)
        self.lockstep.remove(board, "silent")
        self._excuse_orphans()
        self.post.observe(board, self.lockstep.observation(board))
        self._tell(f"{self.joints[board]} was silent for too long; going on without it")

    def _handle(self, event: "zenoh.Sample | Event") -> None:
        if not isinstance(event, tuple):
            board = self.post.torque_keys[str(event.key_expr)]
            if self.lockstep.answer(board, event.payload.to_bytes()):
                self._answered_ns[board] = time.monotonic_ns()
            return
        kind, content = event
        if kind == ENROL:
            self._enrol(content)
        elif kind == CONTROL:
            with content:
                payload = b"" if content.payload is None else content.payload.to_bytes()
                self.watch.enrolled = self.enrolment.enrolled
                reply = control.answer(self.lockstep, self.joints, payload, self.watch)
                content.reply(keys.control(self.rig.name), reply)
        elif kind == STALLED:
            self._starve(content)
        elif kind == FAULT:
            self._fail(content)
        elif content.kind == zenoh.SampleKind.DELETE:
            self._gone(str(content.key_expr))

    def _starve(self, sample: zenoh.Sample) -> None:
        """A board waits for a frame, which never comes if its sender is gone; or it hangs."""
        joint = keys.joint_of(str(sample.key_expr))
        board = self.joints.index(joint)
        try:
            frame = decode(Stalled, sample.payload.to_bytes())
        except ProtocolError as error:
            self.watch.count(f"reports of {joint}", error.reason)
            return
        lockstep = self.lockstep
        current = (lockstep.run_id, lockstep.roster.incarnations[board], lockstep.tick)
        if frame[:3] != current or board not in lockstep.waiting_for:
            return
        if frame.sender == board:
            self.watch.stuck[board] += 1
            self._tell(f"{joint} is stuck in tick {frame.tick}; its own line says where")
        elif frame.sender in neighbours(board, len(self.joints)):
            self._starved[board] = frame.sender
            self._excuse_orphans()

    def _fail(self, sample: zenoh.Sample) -> None:
        """A board has failed; it says so in parts."""
        joint = keys.joint_of(str(sample.key_expr))
        failure = self.lockstep.report(self.joints.index(joint), sample.payload.to_bytes())
        if failure is not None:
            self._tell(f"{joint} has failed in tick {self.lockstep.tick}: {failure}")

    def _enrol(self, query: zenoh.Query) -> None:
        with query:
            try:
                request = decode_request(b"" if query.payload is None else query.payload.to_bytes())
            except ProtocolError as error:
                self._tell(f"cannot read an enrolment request: {error}")
                self.watch.count(ENROLMENT_REQUESTS, error.reason)
                return
            reply = self.enrolment.decide(request)
            if reply.verdict != Verdict.ACCEPTED:
                self._tell(f"refused a board for {request.joint}: {reply.reason}")
            else:
                board = self.joints.index(request.joint)
                if not self.lockstep.roster.present(board):
                    self._newcomers.add(board)
            query.reply(keys.ENROL, encode_enrolment(reply))

    def _gone(self, alive_key: str) -> None:
        joint, boot = keys.board_of(alive_key)
        if joint not in self.joints:
            return
        board = self.joints.index(joint)
        if not self.enrolment.gone(board, boot):
            return
        self._newcomers.discard(board)
        if self.lockstep.roster.present(board):
            expected = board == self._unplugging
            self._unplugging = None if expected else self._unplugging
            self.lockstep.remove(board, "unplugged" if expected else "died")
            self._excuse_orphans()
            if not expected and not self._ending:
                self._tell(f"{joint} died at tick {self.lockstep.tick}; going on without it")

    def _farewell(self, reason: str) -> None:
        """Tell the boards that the run is over, and give them time to hear it."""
        self._ending = True
        self.post.end(encode(End(self.enrolment.run_id, shortened(reason))))
        deadline = time.monotonic() + (HURRIED_S if reason == STOPPED else FAREWELL_S)
        while any(seat.boot is not None for seat in self.enrolment.seats):
            if time.monotonic() > deadline:
                return
            with suppress(Empty):
                self._handle(self.post.events.get(timeout=LOOK_EVERY_S))
