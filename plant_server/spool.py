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

from plant_server.record import Outcome, TickRecord, Undriven
from protocol.scenario import canonical

CHUNK_BYTES = 1 << 18
_HEADER = struct.Struct("<4sII")
_MAGIC = b"DECM"
_SCENARIO, _TICK, _OUTCOME = 0, 1, 2
_REALTIME = 8
PLANT = -1
"""Whose account it is, of a run in realtime, that no board gave."""


class SpoolWriter:
    """Appends records to a new file. Raises OSError if it cannot be made, or is there already."""

    def __init__(self, path: Path, scenario: dict[str, Any]) -> None:
        self.trouble: OSError | None = None
        self._file = path.open("xb")
        self._pack = msgpack.Packer(use_bin_type=True).pack
        self._pending = bytearray(self._pack((_SCENARIO, canonical(scenario))))

    def append(self, record: TickRecord) -> None:
        """Keep one tick."""
        self._pending += self._pack((_TICK, *record))
        if len(self._pending) >= CHUNK_BYTES:
            self._write()

    def append_realtime(self, board: int, content: "bytes | dict[str, float]") -> None:
        """Keep what a board has told of its own time; of `PLANT`, its account."""
        self._pending += self._pack((_REALTIME, board, content))

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
    ticks: list[TickRecord]
    outcome: Outcome | None
    """None: the run was cut off before it could say how it ended."""
    realtime: tuple[tuple[int, Any], ...] = ()
    """Of a run in realtime: traces of boards, each with its number, and the account of `PLANT`."""


def read_spool(path: Path) -> Spool:
    """Read all complete chunks of a spool. Raises ValueError if not even the first is there."""
    scenario: dict[str, Any] | None = None
    ticks: list[TickRecord] = []
    outcome: Outcome | None = None
    realtime = []
    for kind, *fields in _records(path.read_bytes()):
        if kind == _TICK:
            tick, *sequences = fields
            ticks.append(TickRecord(tick, *map(tuple, sequences)))
        elif kind == _OUTCOME:
            tick, angles, rates, ending, wall_s, undriven = fields
            joints = tuple(Undriven(*joint) for joint in undriven)
            outcome = Outcome(tick, tuple(angles), tuple(rates), ending, wall_s, joints)
        elif kind == _REALTIME:
            realtime.append((fields[0], fields[1]))
        else:
            scenario = json.loads(fields[0])
    if scenario is None:
        raise ValueError(f"{path} holds no complete chunk of a run")
    return Spool(scenario, ticks, outcome, tuple(realtime))


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
