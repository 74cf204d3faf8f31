"""The spool: what a run leaves behind while it goes on, for whoever reads it afterwards.

Rule 1: appending is cheap; everything that takes time happens on another thread or after the run.
Rule 2: the spool is chunks (`chunks`) of msgpack records, each a kind and its fields.
Rule 3: trouble with the disk never reaches the control loop; it is told once, and recording stops.
Rule 4: the record of how the run ended is the last one, so without it a spool is incomplete.
Rule 5: the first record says of which version of the wire the frames in it are. Another one is not
        read: its numbers could mean anything.
"""

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import msgpack

from plant_server.session.record import Outcome, TickRecord, TickWallTimes, UndrivenJoint
from plant_server.spool.chunks import ChunkWriter, read_chunks
from protocol.process.machine import EffortMeter
from protocol.robot.canonical_json import canonical_json
from protocol.robot.events import event_of, values_of
from protocol.robot.scenario import Scenario, ScenarioError, canonical
from protocol.robot.scenario import decode as decode_scenario
from protocol.wire.frames import VERSION, Report, decode_report, version_trouble
from protocol.wire.timing import Timing

CHUNK_BYTES = 1 << 18
_SCENARIO, _TICK, _OUTCOME, _FACTS, _REPORT = range(5)
_REALTIME = 8
PLANT = -1
"""Whose account it is, of a run in realtime, that no board gave."""


def to_stderr(line: str) -> None:
    """Tell whoever started this process."""
    print(line, file=sys.stderr, flush=True)


class SpoolWriter:
    """Appends records to a new file. Raises OSError if it cannot be made, or is there already.

    A context: on leaving it, what there is has been written. `tell` is given one line if the
    recording has to stop before the run does.
    """

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        facts: dict[str, Any] | None = None,
        tell: Callable[[str], None] = to_stderr,
    ) -> None:
        self._chunks = ChunkWriter(path, chunk_bytes=CHUNK_BYTES)
        self._pack = msgpack.Packer(use_bin_type=True, default=values_of).pack
        self._tell = tell
        self._told = self._closed = False
        self._chunks.put(self._pack((_SCENARIO, canonical(scenario), VERSION)))
        self.note(facts or {})

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self.close(None)

    @property
    def trouble(self) -> OSError | None:
        """Why nothing is recorded any more."""
        return self._chunks.trouble

    def note(self, facts: dict[str, Any]) -> None:
        """Keep facts about the run; later ones go over earlier ones of the same name."""
        self._chunks.put(self._pack((_FACTS, canonical_json(facts))))

    def keep_report(self, board: int, payload: bytes) -> None:
        """Keep what a board has told for the recording alone, as it came."""
        self._chunks.put(self._pack((_REPORT, board, payload)))

    def keep_realtime(self, board: int, told: bytes | dict[str, float]) -> None:
        """Keep what a board has told of its own time, as it came; of `PLANT`, its account."""
        self._chunks.put(self._pack((_REALTIME, board, told)))

    def append(self, record: TickRecord, walls: TickWallTimes | None) -> None:
        """Keep one tick; in the twin it has no wall times."""
        if self._chunks.trouble is None:
            self._chunks.put(self._pack((_TICK, *record, walls)))
        else:
            self._complain(f"recording stopped at tick {record.tick}", "; the run goes on")

    def close(self, outcome: Outcome | None) -> None:
        """Keep how the run ended, if it did, and write what is left. Closing twice is harmless."""
        if self._closed:
            return
        self._closed = True
        if outcome is not None:
            used = EffortMeter().read()
            self.note({"cpu_s": used.cpu_us / 1e6, "memory_kb": used.memory_kb})
            self._chunks.put(self._pack((_OUTCOME, *outcome)))
        self._chunks.close()
        if self.trouble is not None:
            self._complain("recording is incomplete", "")

    def _complain(self, what: str, and_now: str) -> None:
        if not self._told and self.trouble is not None:
            self._told = True
            self._tell(f"{what}: {self.trouble.strerror}{and_now}")


class Spool(NamedTuple):
    """What was read back."""

    scenario: Scenario
    facts: dict[str, Any]
    """Machine, versions, mode, numeric fingerprint; at the end the plant's own effort."""
    ticks: list[TickRecord]
    walls: list[TickWallTimes | None]
    """One for each tick; None where no clock was read, as in the twin."""
    reports: list[tuple[int, Report]]
    """Boards, and what they told for the recording, in the order in which the plant received it.

    When a run was cut short, boards may tell of the tick that was open as well.
    """
    outcome: Outcome | None
    """None: the run was cut off before it could say how it ended."""
    complete: bool
    """Whether the recording has its end: nothing that happened is missing."""
    realtime: tuple[tuple[int, Any], ...] = ()
    """Of a run in realtime: traces of boards, each with its number, and the account of `PLANT`."""

    @property
    def timings(self) -> list[tuple[int, Timing]]:
        """Boards, and when they did what."""
        return [(board, report) for board, report in self.reports if isinstance(report, Timing)]

    @property
    def in_realtime(self) -> bool:
        """Whether nobody waited for anybody in this run."""
        return self.scenario.realtime is not None


def read_spool(path: Path) -> Spool:
    """Read all complete chunks of a spool.

    Raises ValueError if not even the first is there, or if its scenario is of another version.
    """
    scenario: Scenario | None = None
    facts: dict[str, Any] = {}
    ticks: list[TickRecord] = []
    walls: list[TickWallTimes | None] = []
    reports: list[tuple[int, Report]] = []
    realtime: list[tuple[int, Any]] = []
    outcome: Outcome | None = None
    for kind, *fields in _records(path.read_bytes()):
        if kind == _TICK:
            tick, angles, rates, torques, answers, events, times = fields
            ticks.append(
                TickRecord(
                    tick,
                    tuple(angles),
                    tuple(rates),
                    tuple(torques),
                    tuple(answers),
                    tuple(map(event_of, events)),
                )
            )
            walls.append(
                None if times is None else TickWallTimes(times[0], tuple(times[1]), times[2])
            )
        elif kind == _REPORT:
            board, payload = fields
            reports.append((board, decode_report(payload)))
        elif kind == _OUTCOME:
            tick, angles, rates, ending, wall_s, undriven = fields
            joints = tuple(UndrivenJoint(*joint) for joint in undriven)
            outcome = Outcome(tick, tuple(angles), tuple(rates), ending, wall_s, joints)
        elif kind == _FACTS:
            facts |= json.loads(fields[0])
        elif kind == _REALTIME:
            board, told = fields
            realtime.append((board, told))
        else:
            _check_version(fields[1:])
            scenario = recorded_scenario(fields[0])
    if scenario is None:
        raise ValueError("it holds no complete chunk of a run")
    complete = outcome is not None
    return Spool(scenario, facts, ticks, walls, reports, outcome, complete, tuple(realtime))


def recorded_scenario(payload: bytes) -> Scenario:
    """Read the scenario of a recording. Raises ValueError."""
    try:
        return decode_scenario(payload)
    except ScenarioError as error:
        raise ValueError(f"its scenario: {error}") from error


def _check_version(told: list[Any]) -> None:
    """Refuse another version; a spool of the first one did not tell."""
    trouble = version_trouble(told[0] if told else 1)
    if trouble is not None:
        raise ValueError(trouble)


def _records(content: bytes) -> Iterator[list[Any]]:
    for chunk in read_chunks(content):
        unpacker = msgpack.Unpacker(max_buffer_size=0)
        unpacker.feed(chunk)
        yield from unpacker
