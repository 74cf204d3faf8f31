"""`run.mcap`: a recording as an MCAP file, for viewers, for `decmesh` and for whoever reads JSON.

Rule 1: a file appears under its name when it is whole, and not before.
Rule 2: it holds all that the spool held, so it is read back as one.
Rule 3: metadata say what one wants to know without reading on. Named `decmesh`: the format, the
        version of the wire, whether the recording is complete, `logical_sha256`, scenario, digest,
        ticks. Named `facts`: those.
"""

import math
import os
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import orjson
from mcap.writer import CompressionType, Writer

from deploy.recording.logical_digest import logical_sha256
from deploy.recording.mcap import bodies, realtime, realtime_schema, schema
from deploy.recording.mcap.contents import (
    DAMAGE,
    FACTS,
    FORMAT,
    METADATA,
    WIRE,
    Content,
    Metadata,
    NoRecordingError,
    contents,
)
from deploy.recording.mcap.messages import NS_MAX, RecordingMessages
from deploy.recording.mcap.schema import ChannelKind
from deploy.recording.trajectory import Trajectory
from plant_server.session.record import Outcome, TickRecord, TickWallTimes
from plant_server.spool.spool import PLANT, Spool
from protocol.robot.events import Event
from protocol.robot.scenario import Scenario
from protocol.wire.frames import VERSION, Report

UNFINISHED = ".unfinished"
_REPORTS = {kind.name: report for report, kind in schema.REPORTS.items()}
RELEASE_NS = 1_000_000_000_000
"""Log time of tick 0: 1000 s, so that the warm-up before it has a time as well."""


def write_mcap(spool: Spool, run: Trajectory, path: Path, on_tick: Callable[[int], None]) -> None:
    """Write a recording, of which `run` is the trajectory.

    Raises OSError, or as `RecordingMessages.messages`, and then leaves nothing.
    """
    unfinished = path.with_name(path.name + UNFINISHED)
    try:
        with unfinished.open("wb") as file:
            _write(spool, run, file, on_tick)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def read_mcap(path: Path, *, whole: bool = True) -> Spool:
    """Read a recording back; of one that is not `whole`, what comes before the first damage.

    Raises OSError or `NoRecordingError`.
    """
    reading = _Reading()
    with path.open("rb") as file:
        try:
            _read(file, reading)
        except NoRecordingError:
            raise
        except DAMAGE as error:
            if whole or not reading.ticks:
                left = "decmesh recover reads what" if reading.ticks else "nothing of the run"
                raise NoRecordingError(
                    f"it is damaged or cut off; {left} comes before that"
                ) from error
            return reading.spool()._replace(complete=False)
    if reading.metadata is None:
        raise NoRecordingError("it is an MCAP file, but not of decmesh")
    return reading.spool()


def _read(file: IO[bytes], reading: "_Reading") -> None:
    for item in contents(file):
        if isinstance(item, Content):
            reading.take(*item)
        else:
            reading.metadata = item


def _write(spool: Spool, run: Trajectory, file: IO[bytes], on_tick: Callable[[int], None]) -> None:
    telling = RecordingMessages(spool, run)
    tick_ns = spool.scenario.run.tick_s * 1e9
    writer = Writer(file, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(library="decmesh")
    writer.add_metadata(METADATA, description(spool))
    writer.add_metadata(FACTS, _facts(spool))
    numbers = _declare(writer, telling.channels)
    sequences = dict.fromkeys(numbers, 0)
    for topic, tick, publish_ns, body in telling.messages(on_tick):
        log_ns = min(max(0, RELEASE_NS + round(tick * tick_ns)), NS_MAX)
        writer.add_message(
            numbers[topic],
            log_time=log_ns,
            data=dump(body),
            publish_time=publish_ns if publish_ns > 0 else log_ns,
            sequence=sequences[topic],
        )
        sequences[topic] += 1
    writer.finish()


def _declare(writer: Writer, channels: dict[str, ChannelKind]) -> dict[str, int]:
    """Register schemas and channels; the number of each channel by its topic."""
    schemas = {
        kind.name: writer.register_schema(kind.name, "jsonschema", orjson.dumps(kind.schema))
        for kind in {kind.name: kind for kind in channels.values()}.values()
    }
    return {
        topic: writer.register_channel(topic, "json", schemas[kind.name])
        for topic, kind in channels.items()
    }


def description(spool: Spool) -> Metadata:
    """What the file says of itself."""
    return {
        "format": FORMAT,
        WIRE: str(VERSION),
        "complete": str(spool.complete and spool.outcome is not None).lower(),
        "logical_sha256": logical_sha256(spool),
        "scenario": spool.scenario.name,
        "digest": spool.scenario.digest.hex(),
        "ticks": str(max(0, spool.ticks[-1].tick + 1)),
    }


def _facts(spool: Spool) -> Metadata:
    return {
        name: fact if isinstance(fact, str) else orjson.dumps(fact).decode()
        for name, fact in spool.facts.items()
    }


def dump(body: bodies.Body) -> bytes:
    """Write a body as JSON."""
    data = orjson.dumps(body)
    if b"null" in data:  # Nothing of ours is null: what is no number becomes one here.
        data = orjson.dumps(_spelled(body))
    return data


def _spelled(value: Any) -> Any:
    """The same with a word in place of every number that is none."""
    if isinstance(value, dict):
        return {name: _spelled(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_spelled(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


class _Reading:
    """Puts the records of a spool together from messages, in the order of the file."""

    def __init__(self) -> None:
        self.metadata: dict[str, str] | None = None
        self.scenario: Scenario | None = None
        self.facts: dict[str, Any] = {}
        self.ticks: list[TickRecord] = []
        self.walls: dict[int, TickWallTimes] = {}
        self.reports: list[tuple[int, Report]] = []
        self.outcome: Outcome | None = None
        self.realtime: list[tuple[int, Any]] = []
        self._told: defaultdict[str, list[bodies.Body]] = defaultdict(list)
        """By topic: what boards told, of frames that have more to come."""
        self._joints: list[str] = []
        self._events: list[Event] = []
        self._answers: dict[str, bytes] = {}
        """Events and answers of the tick that is being read."""

    def spool(self) -> Spool:
        """What has been read."""
        if self.scenario is None:
            raise NoRecordingError("it does not say what was run")
        walls = [self.walls.get(record.tick) for record in self.ticks]
        return Spool(
            self.scenario,
            self.facts,
            self.ticks,
            walls,
            self.reports,
            self.outcome,
            complete=self.metadata is not None and self.metadata["complete"] == "true",
            realtime=tuple(self.realtime),
        )

    def take(self, kind: str, topic: str, data: bytes) -> None:
        """Take one message, if the spool had what it says."""
        match kind:
            case schema.SCENARIO.name:
                self.scenario = bodies.to_scenario(orjson.loads(data))
                self._joints = self.scenario.joints
            case schema.FACTS.name:
                self.facts = bodies.to_facts(orjson.loads(data))
            case schema.EVENT.name:
                self._events.append(bodies.to_event(orjson.loads(data)))
            case schema.TORQUE.name:
                self._answers[_joint(topic)] = bodies.to_torque(orjson.loads(data))
            case schema.PLANT_TICK.name:
                answers = [self._answers.get(joint, b"") for joint in self._joints]
                self.ticks.append(bodies.to_tick(orjson.loads(data), answers, self._events))
                self._answers, self._events = {}, []
            case schema.TIMING.name:
                body = orjson.loads(data)
                self.walls[body["tick"]] = bodies.to_walls(body)
            case name if name in _REPORTS:
                board = self._joints.index(_joint(topic))
                report = bodies.to_report(_REPORTS[name], orjson.loads(data))
                self.reports.append((board, report))
            case schema.OUTCOME.name:
                self.outcome = bodies.to_outcome(orjson.loads(data))
            case (
                realtime_schema.TURN.name
                | realtime_schema.LAST_WORD.name
                | realtime_schema.PACE.name
            ):
                self._take_told(kind, topic, orjson.loads(data))

    def _take_told(self, kind: str, topic: str, body: bodies.Body) -> None:
        """Take what was told of a run in realtime; turns when the last of their frame is there."""
        if kind == realtime_schema.PACE.name:
            self.realtime.append((PLANT, realtime.to_pace(body)))
            return
        told = self._told[topic]
        told.append(body)
        if not body.get("follow"):
            self.realtime.append((self._joints.index(_joint(topic)), realtime.to_frame(told)))
            told.clear()


def _joint(topic: str) -> str:
    return topic.split("/")[1]
