"""The watchdog: a thread beside the one that thinks, which says where that one is stuck.

Rule 1: it looks at nothing but a count of how often the loop has gone round. A loop that waits goes
        round as well, several times a second; one that hangs does not, whatever it hangs in.
Rule 2: it decides nothing. In lockstep nobody's clock does: a controller may be in a debugger. Who
        has deadlines to keep passes another `on_stuck`.
Rule 3: it counts its own looks, not seconds: a process that was stopped and goes on is not stuck.
"""

import sys
import threading
import traceback
from collections.abc import Callable
from pathlib import PurePath
from types import TracebackType
from typing import Self

PATIENCE_S = 1.0
LOOKS = 4
"""So many looks without a round are the patience."""
FRAMES_SHOWN = 3


class Watchdog:
    """A context, entered by the thread that is watched.

    `on_stuck` is called from the watchdog's own thread with where the other one is, once each time
    that it gets stuck.
    """

    def __init__(
        self,
        rounds: Callable[[], int],
        on_stuck: Callable[[str], None],
        *,
        patience_s: float = PATIENCE_S,
    ) -> None:
        self.rounds = rounds
        self.on_stuck = on_stuck
        self.patience_s = patience_s
        self._watched = threading.get_ident()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="watchdog", daemon=True)

    def __enter__(self) -> Self:
        self._watched = threading.get_ident()
        self._thread.start()
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        seen, looks = -1, 0
        while not self._over.wait(self.patience_s / LOOKS):
            now = self.rounds()
            looks = looks + 1 if now == seen else 0
            seen = now
            if looks == LOOKS:
                self.on_stuck(self._where())

    def _where(self) -> str:
        """The innermost calls of the thread that is watched."""
        frame = sys._current_frames().get(self._watched)  # noqa: SLF001 - its documented name
        stack = traceback.extract_stack(frame, FRAMES_SHOWN) if frame is not None else []
        return " < ".join(
            f"{PurePath(call.filename).name}:{call.lineno} in {call.name}"
            for call in reversed(stack)
        )
