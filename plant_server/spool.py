"""The spool: what a run leaves behind while it goes on, in chunks that survive a kill.

Rule 1: appending is cheap; everything that takes time happens after the run.
Rule 2: a chunk is its length, its CRC-32, and msgpack records. What was cut off is the last chunk.
Rule 3: trouble with the disk never reaches the control loop; it is told once, and recording stops.
"""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

import msgpack

from plant_server.record import Outcome, TickRecord, Undriven, Walls
from protocol.frames import Timing, decode
from protocol.scenario import canonical

CHUNK_BYTES = 1 << 18
_HEADER = struct.Struct("<4sII")
_MAGIC = b"DECM"
_SCENARIO, _TICK, _OUTCOME, _FACTS, _TIMING = range(5)


class SpoolWriter:
    """Appends records to a new file. Raises OSError if it cannot be made, or is there already."""

    def __init__(
        self, path: Path, scenario: dict[str, Any], facts: dict[str, Any] | None = None
    ) -> None:
        self.trouble: OSError | None = None
        self._file = path.open("xb")
        self._pack = msgpack.Packer(use_bin_type=True).pack
        self._pending = bytearray(self._pack((_SCENARIO, canonical(scenario))))
        self.note(facts or {})

    def note(self, facts: dict[str, Any]) -> None:
        """Keep facts about the run; later ones go over earlier ones of the same name."""
        self._pending += self._pack((_FACTS, canonical(facts)))

    def keep_timing(self, board: int, payload: bytes) -> None:
        """Keep a `Timing` frame of a board, as it came."""
        self._pending += self._pack((_TIMING, board, payload))

    def append(self, record: TickRecord, walls: Walls | None = None) -> None:
        """Keep one tick; in the twin it has no wall times."""
        self._pending += self._pack((_TICK, *record, walls))
        if len(self._pending) >= CHUNK_BYTES:
            self._write()

    def close(self, outcome: Outcome) -> None:
        """Keep how the run ended, and write what is left."""
        self._pending += self._pack((_OUTCOME, *outcome))
        self._write()
        try:
            self._file.close()
        except OSError as error:
            self.trouble = self.trouble or error

    def _write(self) -> None:
        chunk, self._pending = bytes(self._pending), bytearray()
        if self.trouble is not None:
            return
        try:
            self._file.write(_HEADER.pack(_MAGIC, len(chunk), crc32(chunk)) + chunk)
            self._file.flush()
        except OSError as error:
            self.trouble = error


class Spool(NamedTuple):
    """What was read back."""

    scenario: dict[str, Any]
    facts: dict[str, Any]
    """Machine, versions, mode, numeric fingerprint; at the end the plant's own effort."""
    ticks: list[TickRecord]
    walls: list[Walls | None]
    """One for each tick; None where no clock was read, as in the twin."""
    timings: list[tuple[int, Timing]]
    """Boards, and when they did what, in the order in which the plant received it."""
    outcome: Outcome | None
    """None: the run was cut off before it could say how it ended."""
    complete: bool
    """Whether the recording has its end: nothing that happened is missing."""


def read_spool(path: Path) -> Spool:
    """Read all complete chunks of a spool. Raises ValueError if not even the first is there."""
    scenario: dict[str, Any] | None = None
    facts: dict[str, Any] = {}
    ticks: list[TickRecord] = []
    walls: list[Walls | None] = []
    timings: list[tuple[int, Timing]] = []
    outcome: Outcome | None = None
    for kind, *fields in _records(path.read_bytes()):
        if kind == _TICK:
            tick, *sequences, times = fields
            ticks.append(TickRecord(tick, *map(tuple, sequences)))
            walls.append(None if times is None else Walls(times[0], tuple(times[1]), times[2]))
        elif kind == _TIMING:
            board, payload = fields
            timings.append((board, decode(Timing, payload)))
        elif kind == _OUTCOME:
            tick, angles, rates, ending, wall_s, undriven = fields
            joints = tuple(Undriven(*joint) for joint in undriven)
            outcome = Outcome(tick, tuple(angles), tuple(rates), ending, wall_s, joints)
        elif kind == _FACTS:
            facts |= json.loads(fields[0])
        else:
            scenario = json.loads(fields[0])
    if scenario is None:
        raise ValueError(f"{path} holds no complete chunk of a run")
    return Spool(scenario, facts, ticks, walls, timings, outcome, outcome is not None)


def _records(content: bytes) -> Iterator[list[Any]]:
    start = 0
    while start + _HEADER.size <= len(content):
        magic, length, checksum = _HEADER.unpack_from(content, start)
        chunk = content[start + _HEADER.size : start + _HEADER.size + length]
        if magic != _MAGIC or len(chunk) < length or crc32(chunk) != checksum:
            return
        unpacker = msgpack.Unpacker(max_buffer_size=0)
        unpacker.feed(chunk)
        yield from unpacker
        start += _HEADER.size + length
