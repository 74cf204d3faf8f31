"""Pieces of work divided among forks of this process, which have all that is loaded here.

Rule 1: what comes out does not depend on how many processes there were, or on who did which piece.
Rule 2: a piece that no fork came back with is done here, so a fork that is killed costs time alone.
Rule 3: to be called where there is one thread: a fork has no other, nor what those have locked.
"""

import os
import signal
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing import get_all_start_methods, get_context
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from deploy.launch.workers import interrupts_held

Result = TypeVar("Result")
_NUMBER = struct.Struct("<I")
PIECES_MAX = 4096
"""As many numbers as a pipe holds until somebody reads them, and a few less."""


def divided(work: Callable[[int], Result], pieces: int, processes: int) -> list[Result]:
    """Do the pieces 0 ... `pieces` - 1, whoever is free the next; return their results in order."""
    alone = threading.active_count() > 1 or "fork" not in get_all_start_methods()
    forks = 0 if alone or pieces > PIECES_MAX else min(processes, pieces) - 1
    if forks < 1:
        return [work(piece) for piece in range(pieces)]
    reading, writing = os.pipe()
    os.write(writing, b"".join(map(_NUMBER.pack, range(pieces))))
    os.close(writing)
    started = []
    found: dict[int, Result] = {}
    try:
        started += [_start(work, reading) for _ in range(forks)]
        found |= ((piece, work(piece)) for piece in _queued(reading))
        for connection, _process in started:
            with suppress(EOFError, OSError):
                found |= connection.recv()
    finally:
        os.close(reading)
        for connection, process in started:
            process.terminate()
            process.join()
            connection.close()
    return [found[piece] if piece in found else work(piece) for piece in range(pieces)]


def _start(work: Callable[[int], Any], queue: int) -> tuple[Any, Any]:
    context = get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(work, queue, theirs), daemon=True)
    with interrupts_held():
        process.start()
    theirs.close()
    return ours, process


def _serve(work: Callable[[int], Any], queue: int, connection: "Connection[Any, Any]") -> None:
    """Do what is next until nothing is left; an interrupt is the parent's to answer."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    connection.send({piece: work(piece) for piece in _queued(queue)})


def _queued(queue: int) -> Iterator[int]:
    """Numbers that nobody else has taken; a read of so few bytes is whole."""
    while number := os.read(queue, _NUMBER.size):
        yield _NUMBER.unpack(number)[0]
