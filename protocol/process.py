"""How every process of a rig is stopped: a signal, or the end of the one that started it."""

import os
import signal
import sys
import threading
import time
from types import FrameType

STOP_PATIENCE_S = 1.5
"""How long a process may take to close its session before it is ended from within."""


class StoppedError(BaseException):
    """The user, or whoever started this process, wants it to end.

    Not an `Exception`, so that nobody who handles those keeps it for himself.
    """


def stop_on_signals() -> None:
    """Turn SIGINT and SIGTERM into one `StoppedError` in the main thread; later ones do nothing."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        ignore_signals()
        raise StoppedError

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
