"""Many independent pieces of work on all cores; one that is stopped keeps what is done.

Rule 1: a piece of work is a value, its result another, so what comes out does not depend on how
        many cores there were, or on who was first.
Rule 2: no worker outlives this process, and none is waited for in vain.
"""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from threading import Thread
from typing import Any, TypeVar

from deploy.failure import FailedError
from deploy.launch import machine
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError

Work = TypeVar("Work")
Result = TypeVar("Result")


def work_off(
    work: Callable[[Work], Result], pieces: Sequence[Work], on_result: Callable[[Result], object]
) -> tuple[list[Result], bool]:
    """Do all pieces; return the results as they came, and whether they are all there.

    They are not when a `StoppedError` comes up meanwhile. `on_result` is called with each. Raises
    `FailedError` when a worker ends that should not.
    """
    results: list[Result] = []
    workers: dict[Any, SpawnProcess] = {}
    todo = iter(pieces)
    try:
        for _ in range(min(machine.cores(), len(pieces))):
            connection, worker = _start(work)
            workers[connection] = worker
            connection.send(next(todo))
        busy = set(workers)
        while busy:
            ready: list[Any] = wait(list(busy))
            for connection in ready:
                results.append(_received(connection, workers))
                on_result(results[-1])
                try:
                    connection.send(next(todo))
                except StopIteration:
                    busy.remove(connection)
    except StoppedError:
        return results, False
    finally:
        for connection, worker in workers.items():
            worker.terminate()
            worker.join()
            connection.close()
    return results, True


def _start(work: Callable[[Any], Any]) -> tuple[Any, SpawnProcess]:
    resource_tracker.ensure_running()  # Its start lets interrupts through again.
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    worker = context.Process(target=_serve, args=(work, theirs), daemon=True)
    with interrupts_held():
        worker.start()
    theirs.close()
    return ours, worker


def _received(connection: Any, workers: dict[Any, SpawnProcess]) -> Any:
    try:
        return connection.recv()
    except EOFError:
        workers[connection].join()
        code = workers[connection].exitcode
        raise FailedError(
            ExitCode.FAILED,
            f"a worker ended with code {code}; if there is no traceback above, memory may be short",
        ) from None


def _serve(work: Callable[[Any], Any], connection: "Connection[Any, Any]") -> None:
    """Do one piece after the other, until this worker is ended; end with the parent."""
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(ExitCode.STOPPED)

    Thread(target=watch, daemon=True).start()
    while True:
        connection.send(work(connection.recv()))


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Start processes that never see a Ctrl-C: it is their parent's to answer, from the first."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
