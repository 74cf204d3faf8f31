"""Board processes, as the plant's process meets them: who is here, who may drive, what they say.

Everything that the network brings, on whichever thread, goes through one queue to the one thread
that thinks, and is handled here.
"""

import time
from contextlib import suppress
from queue import Empty

import zenoh

from plant_server.process.console import Console
from plant_server.process.network import ALIVE, CONTROL, ENROL, FAULT, STALLED, Event, PlantNetwork
from plant_server.session import control
from plant_server.session.enrolment import Enrolment
from plant_server.session.free_running import FreeRunning
from plant_server.session.lockstep import Lockstep
from plant_server.session.watch import ENROLMENT_REQUESTS, PlantWatch
from plant_server.spool.recorder import Recorder
from protocol.wire import keys
from protocol.wire.enrolment import EnrolmentVerdict, decode_request, encode_enrolment
from protocol.wire.frames import End, ProtocolError, StallReport, decode, encode, shortened

TELL_AFTER_S = 0.5
"""A wait shorter than this is not worth a line."""
LOOK_EVERY_S = 0.02


class BoardProcesses:
    """The processes of one rig's boards."""

    def __init__(
        self,
        network: PlantNetwork,
        enrolment: Enrolment,
        driver: Lockstep | FreeRunning,
        console: Console,
        recorder: Recorder | None,
    ) -> None:
        self.network = network
        self.enrolment = enrolment
        self.driver = driver
        self.console = console
        self.recorder = recorder
        self.joints = enrolment.joints
        self.watch = PlantWatch(self.joints)
        self.answered_ns = [0] * len(self.joints)
        """When the torque frame of each board was taken in this tick; 0: none was."""
        self._unplugging: int | None = None
        self._ending = False
        self._newcomers: set[int] = set()

    def connected(self, board: int) -> bool:
        """Whether a board is enrolled, and hears and is heard by the plant and its neighbours."""
        return self.enrolment.linked(board) and self.network.reaches(board)

    def wait_for(self, board: int) -> None:
        """Let boards in until this one is here, and hears and is heard."""
        started_s = time.monotonic()
        while not self.connected(board):
            self._handle_next()
            if time.monotonic() - started_s > TELL_AFTER_S:
                links = f"the links of {self.joints[board]}"
                self.console.tell(f"waiting for {', '.join(self.enrolment.absent) or links}")

    def admit(self, board: int) -> None:
        """Give a joint to the board that is enrolled for it."""
        self._newcomers.discard(board)
        self.driver.plant.admit(board, self.enrolment.seats[board].incarnation)

    def admit_newcomers(self) -> None:
        """Let in whoever has come unannounced, and is connected."""
        for board in sorted(self._newcomers):
            if self.connected(board) and not self.driver.plant.agenda.expects_plug(board):
                self.admit(board)

    def start(self, board: int) -> None:
        """Have the launcher start a board's process."""
        self.console.say(f"start {self.joints[board]}")

    def kill(self, board: int) -> None:
        """Have the launcher end a board's process."""
        self._unplugging = board
        self.console.say(f"kill {self.joints[board]}")

    def wait_until_gone(self, board: int) -> None:
        """Wait until a board that is to be unplugged has left the roster."""
        started_s = time.monotonic()
        while self.driver.plant.roster.present(board):
            self._handle_next()
            if time.monotonic() - started_s > TELL_AFTER_S:
                joint = self.joints[board]
                self.console.tell(f"waiting for {joint} to be unplugged: end its process")

    def say_goodbye(self, reason: str, patience_s: float) -> None:
        """Tell the boards that the run is over, and give them time to hear it."""
        self._ending = True
        self.network.end(encode(End(self.enrolment.run_id, shortened(reason))))
        deadline_s = time.monotonic() + patience_s
        while any(seat.boot is not None for seat in self.enrolment.seats):
            if time.monotonic() > deadline_s:
                return
            self._handle_next()

    def handle(self, event: "zenoh.Sample | Event") -> None:
        """Take what the network has brought."""
        if not isinstance(event, tuple):
            board = self.network.torque_keys[str(event.key_expr)]
            if self.driver.answer(board, event.payload.to_bytes()):
                self.answered_ns[board] = time.monotonic_ns()
            return
        kind, content = event
        if kind == ENROL:
            self._enrol(content)
        elif kind == CONTROL:
            self._obey(content)
        elif kind == STALLED:
            self.stalled(content)
        elif kind == FAULT:
            self._fail(content)
        elif kind == ALIVE:
            if content.kind == zenoh.SampleKind.DELETE:
                self._gone(str(content.key_expr))
        else:
            self._keep_trace(content)

    def stalled(self, sample: zenoh.Sample) -> StallReport | None:
        """Read what a board says that cannot go on; None, and counted, if it cannot be read."""
        try:
            return decode(StallReport, sample.payload.to_bytes())
        except ProtocolError as error:
            self.watch.count(f"reports of {keys.joint_of(str(sample.key_expr))}", error.reason)
            return None

    def look_for_storms(self) -> None:
        """Tell of storms of frames that cannot be used, now and then."""
        now_s = time.monotonic()
        if now_s > self.watch.storms.due_s:
            self.watch.tell_storms(now_s, self.driver.plant, self.console.tell)

    def board_of(self, sample: zenoh.Sample) -> int:
        """Which board a sample is of."""
        return self.joints.index(keys.joint_of(str(sample.key_expr)))

    def _handle_next(self) -> None:
        with suppress(Empty):
            self.handle(self.network.events.get(timeout=LOOK_EVERY_S))

    def _enrol(self, query: zenoh.Query) -> None:
        with query:
            try:
                request = decode_request(b"" if query.payload is None else query.payload.to_bytes())
            except ProtocolError as error:
                self.console.tell(f"cannot read an enrolment request: {error}")
                self.watch.count(ENROLMENT_REQUESTS, error.reason)
                return
            reply = self.enrolment.decide(request)
            if reply.verdict != EnrolmentVerdict.ACCEPTED:
                self.console.tell(f"refused a board for {request.joint}: {reply.reason}")
            else:
                board = self.joints.index(request.joint)
                if not self.driver.plant.roster.present(board):
                    self._newcomers.add(board)
            query.reply(keys.ENROL, encode_enrolment(reply))

    def _obey(self, query: zenoh.Query) -> None:
        """Answer a terminal."""
        with query:
            payload = b"" if query.payload is None else query.payload.to_bytes()
            self.watch.enrolled = self.enrolment.enrolled
            reply = control.answer(self.driver, self.joints, payload, self.watch)
            query.reply(keys.control(self.enrolment.rig), reply)

    def _fail(self, sample: zenoh.Sample) -> None:
        """A board has failed; it says so in parts."""
        board = self.board_of(sample)
        failure = self.driver.report(board, sample.payload.to_bytes())
        if failure is not None:
            tick = self.driver.plant.tick
            self.console.tell(f"{self.joints[board]} has failed in tick {tick}: {failure}")

    def _keep_trace(self, sample: zenoh.Sample) -> None:
        """A board in realtime tells of its periods."""
        running, board, payload = self.driver, self.board_of(sample), sample.payload.to_bytes()
        assert isinstance(running, FreeRunning)
        if running.take_trace(board, payload) and self.recorder is not None:
            self.recorder.keep_realtime(board, payload)

    def _gone(self, alive_key: str) -> None:
        joint, boot = keys.board_of(alive_key)
        if joint not in self.joints:
            return
        board = self.joints.index(joint)
        if not self.enrolment.gone(board, boot):
            return
        self._newcomers.discard(board)
        if self.driver.plant.roster.present(board):
            expected = board == self._unplugging
            self._unplugging = None if expected else self._unplugging
            self.driver.remove(board, "unplugged" if expected else "died")
            if not expected and not self._ending:
                tick = self.driver.plant.tick
                self.console.tell(f"{joint} died at tick {tick}; going on without it")
