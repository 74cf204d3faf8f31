"""How every process of a rig is stopped: a signal, or the end of the one that started it.

A stop comes as an exception, at whatever the main thread is doing. What must be done whole or not
at all, such as to close a tick and record it, is done `with undisturbed:`; the stop comes after it.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

STOP_PATIENCE_S = 1.5
"""How long a process may take to close its session before it is ended from within."""


START_PATIENCE_S = 5.0
"""How long opening a session and declaring everything may take: it needs a tenth of a second."""


class StoppedError(BaseException):
    """The user, or whoever started this process, wants it to end.

    Not an `Exception`, so that nobody who handles those keeps it for himself.
    """


class StopsHeld:
    """Keeps a stop waiting; a context, for the main thread, not to be entered twice."""

    def __init__(self) -> None:
        self._entered = False
        self._stopped = False

    def __enter__(self) -> None:
        self._entered = True

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        stopped, self._entered, self._stopped = self._stopped, False, False
        if stopped and error is None:
            raise StoppedError

    def stop(self) -> None:
        """Raise `StoppedError`, now or when it no longer disturbs."""
        if not self._entered:
            raise StoppedError
        self._stopped = True


undisturbed = StopsHeld()
"""The one of this process."""


def stop_on_signals() -> None:
    """Turn SIGINT and SIGTERM into one `StoppedError` in the main thread; later ones do nothing."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        ignore_signals()
        undisturbed.stop()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)


def ignore_signals() -> None:
    """Close in peace: from here on the process is ending anyway."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def stop_at_end_of_input() -> None:
    """End with whoever holds the other end of standard input, however that one ended."""

    def watch() -> None:
        while os.read(sys.stdin.fileno(), 1024):
            pass
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(STOP_PATIENCE_S)
        os._exit(signal.SIGTERM)

    threading.Thread(target=watch, name="lifeline", daemon=True).start()


@contextmanager
def restarted_when_stuck(patience_s: float = START_PATIENCE_S) -> Iterator[None]:
    """Start this process anew if what is done within takes too long, as a watchdog resets a board.

    Zenoh can lock itself up when a link comes up in the middle of a declaration (zenoh-c issue
    1308): rare, but for ever, and no signal ends it.
    """

    def restart() -> None:
        print("stuck while it joined the network; starting again", file=sys.stderr, flush=True)
        os.execv(sys.executable, sys.orig_argv)  # noqa: S606 - it is this very program

    watchdog = threading.Timer(patience_s, restart)
    watchdog.daemon = True
    watchdog.start()
    try:
        yield
    finally:
        watchdog.cancel()
