"""Shared memory with a semaphore for each directed pair of roles: the limit; no kernel buffers.

POSIX semaphores in the memory itself, which on Linux are futexes: nobody who does not have to wait
asks the kernel for anything.
"""

import ctypes
import mmap
import os
import time

from tests.bench.job import FRAME_BYTES, LOOK_EVERY_S, Place, partners

SEMAPHORE_BYTES = 64
SLOTS = 2
"""A board may be one tick ahead of its neighbour."""
PAIR_BYTES = SEMAPHORE_BYTES + SLOTS * FRAME_BYTES

_libc = ctypes.CDLL(None, use_errno=True)


class SharedMemory:
    """A file in memory with a place for each directed pair."""

    def __init__(self, place: Place, role: int) -> None:
        roles = place.boards + 1
        path = place.folder / "memory"
        if role == 0:
            part = path.with_suffix(".part")
            part.write_bytes(bytes(roles * roles * PAIR_BYTES))
            part.rename(path)
        while not path.exists():
            time.sleep(LOOK_EVERY_S)
        descriptor = os.open(path, os.O_RDWR)
        self._memory = mmap.mmap(descriptor, roles * roles * PAIR_BYTES)
        os.close(descriptor)
        self._base = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        others = partners(role, place.boards)
        self._out = {other: _Pair(self, role * roles + other) for other in others}
        self._in = {other: _Pair(self, other * roles + role) for other in others}
        for pair in self._in.values():
            _libc.sem_init(pair.semaphore, 1, 0)

    def at(self, pair: int) -> tuple[memoryview, ctypes.c_void_p]:
        """The slots and the semaphore of a pair."""
        start = pair * PAIR_BYTES
        slots = memoryview(self._memory)[start + SEMAPHORE_BYTES : start + PAIR_BYTES]
        return slots, ctypes.c_void_p(self._base + start)

    def put(self, receiver: int, frame: bytes) -> None:
        """Write a frame and post."""
        self._out[receiver].put(frame)

    def get(self, sender: int) -> bytes:
        """Wait for a post and read."""
        return self._in[sender].get()

    def close(self) -> None:
        """Leave it to the end of the process, which unmaps it."""


class _Pair:
    """One direction between two roles."""

    def __init__(self, memory: SharedMemory, number: int) -> None:
        self._slots, self.semaphore = memory.at(number)
        self._turn = 0

    def put(self, frame: bytes) -> None:
        start = self._turn * FRAME_BYTES
        self._slots[start : start + FRAME_BYTES] = frame
        self._turn ^= 1
        _libc.sem_post(self.semaphore)

    def get(self) -> bytes:
        while _libc.sem_wait(self.semaphore) != 0:  # Interrupted by a signal.
            pass
        start = self._turn * FRAME_BYTES
        self._turn ^= 1
        return bytes(self._slots[start : start + FRAME_BYTES])


open_endpoint = SharedMemory
