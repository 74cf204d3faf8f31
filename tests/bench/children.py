"""Processes that a measurement starts: what they say goes to files, and none is left behind."""

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

LOOK_EVERY_S = 0.01
FIFO = "DECMESH_BENCH_FIFO"
"""Set in the environment: every process is started under SCHED_FIFO, before anybody else's."""
LEAVE_WITHIN_S = 2.0


class UnavailableError(Exception):
    """What is to be measured is not here; the message is the line that says so."""


class ChildFailedError(Exception):
    """A process ended in another way than it should, or not at all."""


class Children:
    """A context: on leaving it, every process that was started is gone, and what those started."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        for number in (signal.SIGTERM, signal.SIGKILL):
            for child in self.processes.values():
                with suppress(ProcessLookupError):
                    os.killpg(child.pid, number)
            deadline = time.monotonic() + LEAVE_WITHIN_S
            for child in self.processes.values():
                with suppress(subprocess.TimeoutExpired):
                    child.wait(max(0.0, deadline - time.monotonic()))
        for child in self.processes.values():
            assert child.stdin is not None
            child.stdin.close()

    def start(
        self,
        name: str,
        command: Sequence[str],
        environment: dict[str, str] | None = None,
        where: Path | None = None,
    ) -> subprocess.Popen[bytes]:
        """Start a process in a group of its own; its output goes to `NAME.log`."""
        first = ["chrt", "--fifo", "10"] if os.environ.get(FIFO) else []
        with (self.folder / f"{name}.log").open("wb") as log:
            child = subprocess.Popen(
                [*first, *command],
                stdin=subprocess.PIPE,  # Closed with this process: a lifeline for who reads it.
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **(environment or {})},
                cwd=where,
                start_new_session=True,
            )
        self.processes[name] = child
        return child

    def wait(self, names: Sequence[str], within_s: float) -> None:
        """Wait until these have ended well. Raises `ChildFailedError` as soon as one has not."""
        deadline = time.monotonic() + within_s
        left = list(names)
        while left:
            for name in list(left):
                code = self.processes[name].poll()
                if code == 0:
                    left.remove(name)
                elif code is not None:
                    raise ChildFailedError(f"{name} ended with code {code}: {self.last_line(name)}")
            if time.monotonic() > deadline:
                told = "; ".join(f"{name}: {self.last_line(name)}" for name in left)
                raise ChildFailedError(f"not done within {within_s:g} s: {told}")
            time.sleep(LOOK_EVERY_S)

    def last_line(self, name: str) -> str:
        """The last thing that a process has said."""
        text = (self.folder / f"{name}.log").read_text(errors="replace").strip()
        return text.splitlines()[-1] if text else "(nothing said)"
