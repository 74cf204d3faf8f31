"""A robot as separate processes: starts plant and boards, watches them, and leaves nothing behind.

Every child has a pipe from this process as its standard input. When this process ends, however it
ends, the pipe closes and the children stop by themselves.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, NamedTuple, Self

from deploy.failure import FailedError
from deploy.launch.machine import place
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import Scenario, canonical
from protocol.wire.wiring import RUNTIME_THREADS

STOP_PATIENCE_S = 1.5
"""How long children may take to go by themselves before they are killed."""
POLL_S = 0.02
PLANT_VERDICT_S = 0.5
"""How long the plant may take to say what it makes of a board's end."""
SPOOL = "run.spool"
SCENARIO = "scenario.json"


class RunFailedError(FailedError):
    """A run that did not end by itself."""


class LaunchWatch(NamedTuple):
    """Who follows a run while it goes on."""

    on_tick: Callable[[int], None]
    """How far the run is."""
    on_line: Callable[[str], None]
    """What plant and boards have to say."""


class Processes:
    """Plant and boards of one run, as children of this process.

    A context: on leaving it, every child is gone. The watch is told from other threads.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        watch: LaunchWatch,
        plant_options: Sequence[str] = (),
    ) -> None:
        self.scenario = scenario
        self.folder = folder
        self.watch = watch
        self.plant_options = plant_options
        self.children: dict[str, subprocess.Popen[str]] = {}
        self._readers: list[threading.Thread] = []
        self._under_way = False
        self._roles = ("plant", *scenario.joints)

    def __enter__(self) -> Self:
        (self.folder / SCENARIO).write_bytes(canonical(self.scenario))
        spool = str(self.folder / SPOOL)
        self._start("plant", "plant_server", "--spool", spool, "--progress", *self.plant_options)
        for joint in self.scenario.joints:
            self._start(joint, "module_agent", joint)
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        end(list(self.children.values()))
        for reader in self._readers:
            reader.join()

    def wait(self) -> int:
        """Wait until the run is over; return the plant's exit code.

        Raises `RunFailedError` when a board ended and the plant does not know it.
        """
        plant = self.children["plant"]
        while (code := plant.poll()) is None:
            failed = self._failed_board()
            if failed is not None and self._exit_code(plant, PLANT_VERDICT_S) is None:
                raise RunFailedError(*failed)
            time.sleep(POLL_S)
        return code

    def _failed_board(self) -> tuple[int, str] | None:
        if self._under_way:
            return None  # Boards may come and go; the plant sees to it.
        for name, child in list(self.children.items()):
            code = child.poll()
            if name != "plant" and code not in (None, ExitCode.OK):
                return ExitCode.PEER_LOST if code < 0 else code, f"{name} ended with code {code}"
        return None

    @staticmethod
    def _exit_code(child: subprocess.Popen[str], patience_s: float) -> int | None:
        try:
            return child.wait(patience_s)
        except subprocess.TimeoutExpired:
            return None

    def _start(self, name: str, module: str, *arguments: str) -> None:
        scenario = str(self.folder / SCENARIO)
        child = subprocess.Popen(
            [sys.executable, "-m", module, *arguments, "--scenario", scenario, "--lifeline"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={"ZENOH_RUNTIME": RUNTIME_THREADS, **os.environ},
            start_new_session=True,  # A Ctrl-C is for the launcher; it stops its children.
        )
        place(child.pid, self._roles.index(name), len(self._roles))
        self.children[name] = child
        assert child.stdout is not None
        assert child.stderr is not None
        # A controller from outside may print; only the plant has something to say to us.
        self._read(child.stdout, self._obey if name == "plant" else self.watch.on_line)
        self._read(child.stderr, self.watch.on_line)

    def _obey(self, line: str) -> None:
        """Do what the plant says: how far it is, or which board to end or to start."""
        word, argument = line.split()
        if word == "kill":
            self.children[argument].kill()
        elif word == "start":
            ended = self.children[argument]
            ended.wait()
            assert ended.stdin is not None
            ended.stdin.close()
            self._start(argument, "module_agent", argument)
        else:
            self.watch.on_tick(int(word))
            self._under_way = True

    def _read(self, stream: IO[str], use: Callable[[str], None]) -> None:
        def read() -> None:
            with stream:
                for line in stream:
                    use(line.rstrip())

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        self._readers.append(reader)


def end(children: Sequence[subprocess.Popen[str]]) -> None:
    """End processes: ask all, and kill those that take too long."""
    deadline = time.monotonic() + STOP_PATIENCE_S
    for child in children:
        if child.poll() is None:
            child.terminate()
    for child in children:
        try:
            child.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
        assert child.stdin is not None
        child.stdin.close()
