"""A recording as messages: what is said on which channel of `run.mcap`, and when.

Rule 1: the log time is the body's: tick k at `RELEASE_NS` + k ticks. It is the same for every run
        of a scenario. The publish time is the wall's, monotonic; where none is known it is the log
        time, as the format wants it.
Rule 2: messages come tick by tick. A link frame is with the tick in which it was said, though its
        fate is known only later, so a tick is held back until the fates of its frames are known.
Rule 3: what came from the recording is in them byte for byte, so it can be read back.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from deploy.recording.epochs import epochs
from deploy.recording.fates import FrameOutcome
from deploy.recording.frame_fate import FrameFate
from deploy.recording.mcap import bodies, realtime, realtime_schema, schema, topics
from deploy.recording.mcap.bodies import Body
from deploy.recording.mcap.schema import ChannelKind
from deploy.recording.reconstruction import (
    RealtimeReconstruction,
    ReconstructedTick,
    Reconstruction,
)
from deploy.recording.replay import UnplayableError
from deploy.recording.trajectory import Trajectory
from plant_server.session.record import TickRecord, TickWallTimes
from plant_server.spool.spool import PLANT, Spool
from protocol.robot.cadence import cadence_of
from protocol.wire.frames import REPORTS
from protocol.wire.trace import LastWord, Trace
from protocol.wire.trace_differences import decode_told
from protocol.wire.wiring import neighbours

NS_MAX = 2**63 - 1
"""What fits into the file; a board of another's making may say any time."""


class Message(NamedTuple):
    """One message."""

    topic: str
    tick: int
    publish_ns: int
    """Wall time; 0: not known."""
    body: Body


def channels(joints: list[str], *, in_realtime: bool = False) -> dict[str, ChannelKind]:
    """Every channel of a robot's recording, and what its messages say."""
    found = {
        topics.SCENARIO: schema.SCENARIO,
        topics.FACTS: schema.FACTS,
        topics.PLANT_TICK: schema.PLANT_TICK,
        topics.EPOCH: schema.EPOCH,
        topics.EVENT: schema.EVENT,
        topics.TIMING: schema.TIMING,
        topics.REFUSED: schema.REFUSED,
        topics.OUTCOME: schema.OUTCOME,
    }
    for board, joint in enumerate(joints):
        found[topics.observation(joint)] = schema.OBSERVATION
        found[topics.torque(joint)] = schema.TORQUE
        for kind in REPORTS:
            found[topics.report(joint, kind)] = schema.REPORTS[kind]
        if in_realtime:
            found[topics.torque(joint)] = realtime_schema.IN_FORCE
            found[topics.turn(joint)] = realtime_schema.TURN
            found[topics.last_word(joint)] = realtime_schema.LAST_WORD
            continue
        for other in neighbours(board, len(joints)):
            found[topics.link(joint, joints[other])] = schema.LINK
    if in_realtime:
        found |= {topics.EPOCH: realtime_schema.ELECTED, topics.PACE: realtime_schema.PACE}
    return found


class PendingTick:
    """A tick that waits until it is known what became of its frames."""

    def __init__(self, told: ReconstructedTick, walls: TickWallTimes | None) -> None:
        self.told = told
        self.walls = walls
        self.fates: list[FrameOutcome] = []


Account = Trace | LastWord | None
"""What a board told of its turns; None: it is the plant's account."""


class RecordingMessages:
    """Turns a recording into messages."""

    def __init__(self, spool: Spool, run: Trajectory) -> None:
        self.spool = spool
        self.scenario = spool.scenario
        self.joints = self.scenario.joints
        cadence = cadence_of(spool.scenario)
        self.channels = channels(self.joints, in_realtime=cadence is not None)
        self._told = RealtimeReconstruction(spool) if cadence else Reconstruction(self.scenario)
        self._periods = cadence.ticks_per_period if cadence else ()
        self._accounts = _decoded(spool.realtime if cadence else ())
        self._next_account = next(self._accounts, None)
        self._held: dict[int, PendingTick] = {}
        self._reports = deque(spool.reports)
        self._epochs = deque(bodies.of_epochs(epochs(run), self.joints))
        self._spoken_ns = {
            (board, timing.tick + i): min(timing.base_ns + tick.decided_us * 1000, NS_MAX)
            for board, timing in spool.timings
            for i, tick in enumerate(timing.ticks)
        }

    def messages(self, on_tick: Callable[[int], None]) -> Iterator[Message]:
        """Tell it from the first tick to the last. Raises as `Reconstruction.tick`."""
        spool = self.spool
        first_tick = spool.ticks[0].tick
        yield Message(topics.SCENARIO, first_tick, 0, bodies.of_scenario(self.scenario))
        yield Message(topics.FACTS, first_tick, 0, bodies.of_facts(spool.facts))
        for record, walls in zip(spool.ticks, spool.walls, strict=True):
            yield from self._tick(record, walls)
            on_tick(record.tick)
        self._settle(self._told.end())
        for tick, held in self._held.items():
            yield from self._tell(tick, held)
        while self._reports:
            yield self._report()
        yield from self._realtime(spool.ticks[-1].tick, to_the_end=True)
        yield Message(topics.REFUSED, spool.ticks[-1].tick, 0, self._refused())
        if spool.outcome is not None:
            body = bodies.of_outcome(spool.outcome)
            yield Message(topics.OUTCOME, spool.outcome.tick, 0, body)

    def _refused(self) -> Body:
        return bodies.of_refused(
            {
                (self.joints[sender], self.joints[receiver]): self._told.refused((sender, receiver))
                for sender, receiver in self._told.links
            },
            {
                joint: self._told.refused_by_network(board)
                for board, joint in enumerate(self.joints)
            },
        )

    def _tick(self, record: TickRecord, walls: TickWallTimes | None) -> Iterator[Message]:
        """Take one tick; give those that can be told in full by now."""
        told = self._told.tick(record)
        self._held[record.tick] = PendingTick(told, walls)
        self._settle(told.settled)
        while self._held:
            tick, held = next(iter(self._held.items()))
            if len(held.fates) < len(self._told.links):
                return
            del self._held[tick]
            yield from self._tell(tick, held)

    def _settle(self, settled: list[FrameOutcome]) -> None:
        for frame in settled:
            if frame.said_tick not in self._held:
                raise UnplayableError(f"a frame of tick {frame.said_tick} is told of again")
            self._held[frame.said_tick].fates.append(frame)

    def _tell(self, tick: int, held: PendingTick) -> Iterator[Message]:
        told, walls = held.told, held.walls
        opened_ns = walls.opened_ns if walls else 0
        for event in told.recorded.events:
            yield Message(topics.EVENT, tick, opened_ns, bodies.of_event(tick, event))
        for board, observation in told.observations.items():
            body = bodies.of_observation(observation)
            yield Message(topics.observation(self.joints[board]), tick, opened_ns, body)
        yield from self._answers(tick, held)
        for frame in held.fates:
            message = self._link(frame, told)
            if message is not None:
                yield message
        closed_ns = walls.closed_ns if walls else 0
        yield Message(topics.PLANT_TICK, tick, closed_ns, bodies.of_tick(told.recorded))
        if walls is not None:
            yield Message(topics.TIMING, tick, walls.closed_ns, bodies.of_walls(tick, walls))
        while self._reports and self._reports[0][1].tick <= tick:
            yield self._report()
        yield from self._realtime(tick)
        while self._epochs and self._epochs[0]["tick"] == tick:
            yield Message(topics.EPOCH, tick, 0, self._epochs.popleft())

    def _answers(self, tick: int, held: PendingTick) -> Iterator[Message]:
        answers = zip(self.joints, held.told.answers, held.told.recorded.answers, strict=True)
        for board, (joint, frame, payload) in enumerate(answers):
            if frame is not None:
                answered_ns = held.walls.answered_ns[board] if held.walls else 0
                body = bodies.of_torque(frame, payload)
                yield Message(topics.torque(joint), tick, answered_ns, body)

    def _link(self, frame: FrameOutcome, told: ReconstructedTick) -> Message | None:
        sender, receiver = frame.link
        answer = told.answers[sender]
        if frame.fate is FrameFate.UNSAID:
            return None
        place = neighbours(sender, len(self.joints)).index(receiver)
        return Message(
            topics.link(self.joints[sender], self.joints[receiver]),
            frame.said_tick,
            self._spoken_ns.get((sender, frame.said_tick), 0),
            bodies.of_link(
                frame, answer and answer.links[place].sent_crc, told.links.get(frame.link)
            ),
        )

    def _report(self) -> Message:
        board, report = self._reports.popleft()
        topic = topics.report(self.joints[board], type(report))
        published_ns: int = getattr(report, "base_ns", 0)
        return Message(topic, report.tick, published_ns, bodies.of_report(report))

    def _realtime(self, tick: int, *, to_the_end: bool = False) -> Iterator[Message]:
        """What boards told of turns that are over by a tick, in the order in which it came."""
        while self._next_account is not None:
            board, payload, told = self._next_account
            if told is None:
                yield Message(topics.PACE, tick, 0, payload)
            elif isinstance(told, LastWord):
                body = realtime.of_last_word(told, payload)
                yield Message(topics.last_word(self.joints[board]), tick, 0, body)
            else:
                period = self._periods[board]
                if told.lived[-1].slot * period > tick and not to_the_end:
                    return
                for body in realtime.of_trace(told, payload, period):
                    spoken_ns = min((body["woke_us"] + body["busy_us"]) * 1000, NS_MAX)
                    yield Message(topics.turn(self.joints[board]), body["tick"], spoken_ns, body)
            self._next_account = next(self._accounts, None)


def _decoded(realtime: Iterable[tuple[int, Any]]) -> Iterator[tuple[int, Any, Account]]:
    """What boards told; the plant's account as it is. One by one, for a long run has many."""
    for board, told in realtime:
        yield board, told, None if board == PLANT else decode_told(told)
