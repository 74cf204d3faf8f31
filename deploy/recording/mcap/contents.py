"""What is in an MCAP file of ours: its messages as they are, in the order of the file.

Rule 1: nothing is decoded here but the container: chunks, their checksums, channels, schemas.
Rule 2: whatever a damaged file comes to is one of `DAMAGE`.
"""

import struct
from collections.abc import Container, Iterator
from io import BytesIO
from typing import IO, NamedTuple

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.records import Metadata as MetadataRecord
from mcap.stream_reader import StreamReader, get_chunk_data_stream
from zstandard import ZstdError

from protocol.wire.frames import version_trouble

FORMAT = "2"
"""Of what is on the channels; another one cannot be read."""
METADATA, FACTS = "decmesh", "facts"
"""Names of the metadata: what the file is, and facts of the run."""
WIRE = "wire"
"""Which of the former says what version of the wire the frames are of."""
DAMAGE = (
    McapError,
    ZstdError,
    msgspec.MsgspecError,
    struct.error,
    AssertionError,
    AttributeError,
    LookupError,
    OverflowError,
    TypeError,
    ValueError,
)
"""What reading a damaged file can come to."""
_RECORD = struct.Struct("<BQH")
"""Head of a record in a chunk: kind, length and, of a message, its channel."""
_MESSAGE = struct.Struct("<BQHIQQ")
"""The whole head of a message: then its sequence and its two times."""
_RECORD_HEAD_BYTES = 9


class Content(NamedTuple):
    """A message as it is in the file."""

    kind: str
    """Name of its schema."""
    topic: str
    data: bytes


Metadata = dict[str, str]
"""What a file says of itself."""


class NoRecordingError(ValueError):
    """An MCAP file that is none of ours, not whole, or not of this format; says why."""


class Registry:
    """What has been registered in a file so far."""

    def __init__(self, kinds: Container[str] | None = None) -> None:
        self.channels: dict[int, tuple[str, str]] = {}
        """Kind and topic of each channel, by its number."""
        self.wanted: set[int] = set()
        """Channels with messages of the kinds that are asked for."""
        self._kinds = kinds
        self._names: dict[int, str] = {}

    def take(self, record: Schema | Channel) -> None:
        """Know one more."""
        if isinstance(record, Schema):
            self._names[record.id] = record.name
            return
        kind = self._names[record.schema_id]
        self.channels[record.id] = kind, record.topic
        if self._kinds is None or kind in self._kinds:
            self.wanted.add(record.id)


def contents(file: IO[bytes]) -> Iterator[Metadata | Content]:
    """Give the file's own metadata and all of its messages, in the order of the file.

    Raises one of `DAMAGE`.
    """
    registry = Registry()
    for part in parts(file, registry):
        if isinstance(part, dict):
            yield part
            continue
        for number, data in messages(part, registry):
            yield Content(*registry.channels[number], data)


def parts(file: IO[bytes], registry: Registry) -> Iterator[Metadata | bytes]:
    """Give the file's own metadata, and its chunks for `messages`. Raises one of `DAMAGE`."""
    for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
        if isinstance(record, MetadataRecord):
            if record.name == METADATA:
                yield _described(record.metadata)
        elif isinstance(record, Chunk):
            stream, size = get_chunk_data_stream(record, validate_crc=True)
            yield stream.read(size)
        elif isinstance(record, Schema | Channel):
            registry.take(record)
        elif isinstance(record, Message):  # A chunk of its own, of a file that has none.
            size = _MESSAGE.size - _RECORD_HEAD_BYTES + len(record.data)
            head = Opcode.MESSAGE, size, record.channel_id, record.sequence
            yield _MESSAGE.pack(*head, record.log_time, record.publish_time) + record.data


def _described(metadata: Metadata) -> Metadata:
    """The file's own word for what it is. Raises `NoRecordingError` for another version of it."""
    if metadata["format"] != FORMAT:
        raise NoRecordingError(
            f"it has format {metadata['format']}, and this decmesh reads format {FORMAT}"
        )
    trouble = version_trouble(int(metadata.get(WIRE, "1")))  # The first version did not tell.
    if trouble is not None:
        raise NoRecordingError(trouble)
    return metadata


def messages(chunk: bytes, registry: Registry) -> Iterator[tuple[int, bytes]]:
    """Walk through a chunk: the messages that are wanted, each with the number of its channel.

    The library's own way takes four times as long. Raises one of `DAMAGE`.
    """
    unpack, wanted, size, at = _RECORD.unpack_from, registry.wanted, len(chunk), 0
    while at < size:
        opcode, length, number = unpack(chunk, at)
        start, at = at, at + _RECORD_HEAD_BYTES + length
        if at > size:
            raise ValueError("a record is longer than its chunk")
        if opcode == Opcode.MESSAGE:
            if number in wanted:
                yield number, chunk[start + _MESSAGE.size : at]
            elif number not in registry.channels:
                raise ValueError(f"a message is on channel {number}, which there is not")
        elif opcode in (Opcode.CHANNEL, Opcode.SCHEMA):
            kind = Channel if opcode == Opcode.CHANNEL else Schema
            registry.take(
                kind.read(ReadDataStream(BytesIO(chunk[start + _RECORD_HEAD_BYTES : at])))
            )
