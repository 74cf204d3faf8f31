"""The plant's console: its user reads standard error, its launcher reads standard output."""

import sys
import time

SHOW_EVERY_S = 0.1


class Console:
    """Lines of one plant process; without a `launcher` nobody reads its standard output."""

    def __init__(self, *, launcher: bool) -> None:
        self._launcher = launcher
        self._shown_s = 0.0
        self._told = ""

    def tell(self, line: str) -> None:
        """Tell the user, once."""
        if line != self._told:
            self._told = line
            print(f"plant: {line}", file=sys.stderr, flush=True)

    def say(self, line: str) -> None:
        """Tell the launcher, if there is one."""
        if self._launcher:
            print(line, flush=True)

    def show(self, tick: int, released_s: float | None) -> None:
        """Tell the launcher how far the run is, now and then."""
        if not self._launcher or released_s is None:
            return
        now_s = time.monotonic()
        if now_s - self._shown_s >= SHOW_EVERY_S:
            self._shown_s = now_s
            self.say(f"{tick} {now_s - released_s:.6f}")
