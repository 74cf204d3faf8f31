"""Chunks: a file of records that survives a kill, and a disk that is slow, full or gone.

Rule 1: whoever puts a record never waits and never meets an error. A thread of its own writes.
Rule 2: a chunk is its length, its CRC-32, and records. What was cut off is the last chunk.
Rule 3: a chunk is written when it is full, and after a second at the latest, so a kill loses no
        more than that. It is also forced to the disk, so nor does a power cut.
Rule 4: after the first trouble nothing more is written: what follows a hole would not be read.
"""

import errno
import os
import struct
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from zlib import crc32

BACKLOG_BYTES_MAX = 16 << 20
"""How far the disk may fall behind: some ten seconds of a run."""
WRITE_EVERY_S = 1.0
CLOSE_WITHIN_S = 5.0
"""How long the end of a run waits for the disk."""
_HEADER = struct.Struct("<4sII")
MAGIC = b"DECM"


class ChunkWriter:
    """Writes a new file. Raises OSError if it cannot be made, or is there already."""

    def __init__(self, path: Path, *, chunk_bytes: int) -> None:
        self.trouble: OSError | None = None
        """Why nothing is written any more."""
        self.chunk_bytes = chunk_bytes
        self._file = path.open("xb")
        self._records: deque[bytes] = deque()
        # One number for each thread, so that neither needs a lock.
        self._put_bytes = 0
        self._taken_bytes = 0
        self._wake = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._work, name="spool", daemon=True)
        self._thread.start()

    def put(self, record: bytes) -> None:
        """Have a record written, some time."""
        if self.trouble is not None:
            return
        self._records.append(record)
        self._put_bytes += len(record)
        backlog_bytes = self._put_bytes - self._taken_bytes
        if backlog_bytes < self.chunk_bytes:
            return
        self._wake.set()
        if backlog_bytes > BACKLOG_BYTES_MAX:
            self.trouble = OSError(errno.EAGAIN, "the disk is too slow")

    def close(self) -> None:
        """Write what is left, and wait for it, but not for ever."""
        self._closing = True
        self._wake.set()
        self._thread.join(CLOSE_WITHIN_S)
        if self._thread.is_alive() and self.trouble is None:
            self.trouble = OSError(errno.EAGAIN, "the disk is too slow")

    def _work(self) -> None:
        """On a thread of its own: write now and then, until there is trouble or no more to come."""
        closing = False
        try:
            with self._file:
                while self.trouble is None and not closing:
                    self._wake.wait(WRITE_EVERY_S)
                    self._wake.clear()
                    closing = self._closing  # Before looking what there is: none comes after it.
                    self._write()
        except OSError as error:
            self.trouble = self.trouble or error

    def _write(self) -> None:
        """Write all that there is."""
        records = self._records
        if not records:
            return
        while records and self.trouble is None:
            chunk = bytearray()
            while records and len(chunk) < self.chunk_bytes:
                chunk += records.popleft()
            self._file.write(_HEADER.pack(MAGIC, len(chunk), crc32(chunk)) + chunk)
            self._file.flush()
            self._taken_bytes += len(chunk)
        os.fsync(self._file.fileno())


def read_chunks(content: bytes) -> Iterator[bytes]:
    """Take complete chunks from the beginning of a file, up to the first that is not."""
    start = 0
    while start + _HEADER.size <= len(content):
        magic, length, checksum = _HEADER.unpack_from(content, start)
        start += _HEADER.size
        chunk = content[start : start + length]
        if magic != MAGIC or len(chunk) < length or crc32(chunk) != checksum:
            return
        yield chunk
        start += length
