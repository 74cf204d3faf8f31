"""Drives the plant by the wall clock: lockstep at a pace, and realtime, where nobody is waited for.

Rule 1: between two ticks this thread waits for the wall clock. At a pace it looks at what comes at
        once, as in lockstep; in realtime it sleeps, and looks when the next tick is due.
Rule 2: a host that is too slow is told by how much, seldom, and the run is played to its end.
Rule 3: in realtime boards are started and ended, and come and go, while the body moves. A board
        that has lost its token, or has been silent for the lease, is gone.
"""

import time
from contextlib import suppress
from queue import Empty

import zenoh

from plant_server.process.network import Event, Post
from plant_server.process.options import Options
from plant_server.process.runtime import Runtime
from plant_server.record import Outcome, Walls
from plant_server.session.config import PlantConfig, plant_config
from plant_server.session.free_running import FreeRunning
from plant_server.session.pace import Pace
from plant_server.spool.spool import PLANT, SpoolWriter
from protocol.process.stopping import undisturbed
from protocol.robot.events import Plug, StaleTorque, Unplug
from protocol.robot.scenario import Scenario
from protocol.wire import keys
from protocol.wire.wiring import Rig

TRACE = -1
"""Kind of an event, besides those of `network`: a board tells what it lived through."""
COMPLAIN_EVERY_S = 1.0


class PacedRuntime(Runtime):
    """A plant whose ticks are tied to the wall clock."""

    late = "the run did not keep"
    """It may be the host, or a board that was waited for."""

    def __init__(
        self,
        post: Post,
        scenario: Scenario,
        rig: Rig,
        options: Options,
        writer: SpoolWriter | None,
    ) -> None:
        super().__init__(post, scenario, rig, options, writer)
        run = scenario.run
        factor = options.pace or run.pace or 1.0
        self.aim = f"pace {factor:g}"
        self.pace = Pace(tick_s=run.tick_s, pace=factor)

    def _boundary(self) -> None:
        self._await_due()
        super()._boundary()

    def _await_due(self) -> None:
        while (wait_s := self.pace.wait_s(self.lockstep.tick, time.monotonic())) > 0.0:
            with suppress(Empty):
                self._handle(self.post.events.get(timeout=wait_s))

    def _conclude(self, outcome: Outcome) -> None:
        self._tell_pace()
        super()._conclude(outcome)

    def _tell_pace(self) -> None:
        if self.pace.slipped_s > 0.0:
            self._tell(
                f"{self.late} {self.aim}: {self.pace.slipped_s:.2f} s of wall time were given up"
            )


class RealtimeRuntime(PacedRuntime):
    """A plant that waits for nobody but the wall clock."""

    late = "the host is too slow for"

    def __init__(
        self,
        post: Post,
        scenario: Scenario,
        rig: Rig,
        options: Options,
        writer: SpoolWriter | None,
    ) -> None:
        super().__init__(post, scenario, rig, options, writer)
        self.aim = "realtime"
        self._complained_s = 0.0
        put = self.post.events.put

        def left(sample: zenoh.Sample) -> None:
            put((TRACE, sample))

        self._traces = [
            post.session.declare_subscriber(
                keys.trace(rig.name, joint), zenoh.handlers.Callback(left, indirect=False)
            )
            for joint in self.joints
        ]

    @property
    def free_running(self) -> FreeRunning:
        """The plant, which is not the one of lockstep."""
        assert isinstance(self.lockstep, FreeRunning)
        return self.lockstep

    def _make_plant(self, config: PlantConfig) -> FreeRunning:
        return FreeRunning(config, run_id=self.enrolment.run_id)

    def _await_due(self) -> None:
        tick = self.lockstep.tick
        while (wait_s := self.pace.wait_s(tick, time.monotonic())) > 0.0:
            time.sleep(wait_s)
        while not self.post.events.empty():
            self._handle(self.post.events.get())

    def _boundary(self) -> None:
        """Between two ticks: boards come and go, and nobody waits until they have."""
        self._await_due()
        lockstep = self.lockstep
        match lockstep.begin():
            case Unplug(board) if lockstep.roster.present(board):
                self._unplugging = board
                self._say(f"kill {self.joints[board]}")
            case Plug(board) if not lockstep.roster.present(board):
                self._say(f"start {self.joints[board]}")
        for board in sorted(self._newcomers):
            if self._connected(board) and not lockstep.agenda.expects_plug(board):
                self._admit(board)

    def _tick(self) -> None:
        lockstep = self.lockstep
        if lockstep.tick == 0:
            self._released_s = time.monotonic()
        opened_ns = time.monotonic_ns()
        for board, payload in lockstep.open():
            self.post.observe(board, payload)
        walls = Walls(opened_ns, tuple(self._answered_ns), time.monotonic_ns())
        self._answered_ns = [0] * len(self.joints)
        with undisturbed:  # A body that is half way to the next tick is no ending.
            record = lockstep.close()
            if self.recorder is not None:
                self.recorder.keep(record, walls)
                self.recorder.write(())
        for event in record.events:
            if isinstance(event, StaleTorque):
                self._complain(event.board)
        now_s = time.monotonic()
        if now_s > self.watch.storms.due_s:
            self.watch.tell_storms(now_s, lockstep, self._tell)
        self.voice.show(record.tick, self._released_s)

    def _complain(self, board: int) -> None:
        now_s = time.monotonic()
        if now_s - self._complained_s >= COMPLAIN_EVERY_S:
            self._complained_s = now_s
            age_ms = self.free_running.cadence.age_ticks_max * self.lockstep.config.tick_s * 1e3
            self._tell(
                f"{self.joints[board]}'s torque was older than {age_ms:g} ms at tick"
                f" {self.lockstep.tick - 1}, for no newer one had come; 0 N m until one does"
            )

    def _handle(self, event: "zenoh.Sample | Event") -> None:
        if isinstance(event, tuple) and event[0] == TRACE:
            sample: zenoh.Sample = event[1]
            board = self.joints.index(keys.joint_of(str(sample.key_expr)))
            payload = sample.payload.to_bytes()
            if self.free_running.lived(board, payload) and self.recorder is not None:
                self.recorder.keep_realtime(board, payload)
        else:
            super()._handle(event)

    def _conclude(self, outcome: Outcome) -> None:
        if self.recorder is not None:
            behind_ms_max = self.pace.behind_s_max * 1e3
            account = {"behind_ms_max": behind_ms_max, "slipped_s": self.pace.slipped_s}
            self.recorder.keep_realtime(PLANT, account)
        super()._conclude(outcome)


def runtime_for(
    post: Post,
    scenario: Scenario,
    rig: Rig,
    options: Options,
    writer: SpoolWriter | None,
) -> Runtime:
    """The runtime that a scenario and the command line ask for."""
    if plant_config(scenario).cadence is not None:
        return RealtimeRuntime(post, scenario, rig, options, writer)
    if options.pace is not None or scenario.run.pace is not None:
        return PacedRuntime(post, scenario, rig, options, writer)
    return Runtime(post, scenario, rig, options, writer)
