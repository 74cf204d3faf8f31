"""Real processes of one robot, as somebody would start them by hand."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from deploy.launch.twin import run_twin
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from plant_server.spool.spool import read_spool
from protocol.robot.scenario import Scenario, canonical

PATIENCE_S = 30.0
"""For what must happen, however slow the machine is."""

Process = subprocess.Popen[str]


class Rig:
    """Processes of one robot, started by hand: ports of its own, output kept in files."""

    def __init__(self, folder: Path, scenario: Scenario) -> None:
        self.folder = folder
        self.scenario = scenario
        self.file = folder / "scenario.json"
        self.file.write_bytes(canonical(scenario))
        self.processes: list[Process] = []

    def start(self, *command: str, name: str = "") -> Process:
        """Start `python -m COMMAND`; what it says goes to `said`."""
        log = (self.folder / f"{name or command[0]}.{len(self.processes)}.log").open("w")
        with log:
            process = subprocess.Popen(
                [sys.executable, "-m", *command],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                text=True,
                start_new_session=True,
            )
        process.log = Path(log.name)  # type: ignore[attr-defined]
        self.processes.append(process)
        return process

    def plant(self, *options: str) -> Process:
        return self.start("plant_server", "--scenario", str(self.file), *options)

    def board(self, joint: str, *options: str) -> Process:
        return self.start("module_agent", joint, "--scenario", str(self.file), *options)

    def free(self) -> bool:
        """Whether every port of the rig can be listened on again."""
        rig = self.scenario.rig
        ports = range(rig.base_port, rig.base_port + 1 + len(self.scenario.joints))
        return all(_can_listen(rig.host, port) for port in ports)


def said(process: Process) -> str:
    """What a process has written so far."""
    path: Path = process.log  # type: ignore[attr-defined]
    return path.read_text()


def eventually(condition: Callable[[], object], patience_s: float = PATIENCE_S) -> None:
    """Wait until something is so; fail if it never is."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def recorded_ticks(spool: Path) -> int:
    """How many ticks of a run can be read from its spool by now."""
    with contextlib.suppress(OSError, ValueError):
        return len(read_spool(spool).ticks)
    return 0


def children_of(pid: int) -> list[int]:
    """Processes that a process has started and that still run."""
    try:
        return [child.pid for child in psutil.Process(pid).children() if alive(child.pid)]
    except psutil.NoSuchProcess:
        return []


def alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and was not waited for does not."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def command_line(pid: int) -> list[str]:
    return psutil.Process(pid).cmdline()


def _can_listen(host: str, port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
        return True


def twin_digest(*settings: str, source: str = "paper") -> str:
    """The trajectory that the twin has for a scenario."""
    scenario = load(source, list(settings))
    return trajectory(scenario, *run_twin(scenario)).state_sha256


def decmesh(*arguments: str, patience_s: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run a command of `decmesh` to its end."""
    command = [sys.executable, "-m", "deploy", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=patience_s)


class Launched:
    """`decmesh run` under way, in a folder of its own; without boards, joints hold."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "deploy", "run", "paper", "--out", str(folder), *options]
        settings = ["--set", "run.duration_s=600", "--set", "unattended.how=braked"]
        self.launcher = subprocess.Popen(
            [*command, *settings], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
        )
        eventually(lambda: self.ask("status").returncode == 0)
        eventually(lambda: self.status()["tick"] > 0)

    def ask(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Type a command about this robot in another terminal."""
        return decmesh(*words, "--rig", str(self.folder.resolve()))

    def status(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.ask("status", "--json").stdout)
        return found

    def board(self, joint: str) -> dict[str, Any]:
        """What the status says of a board."""
        boards: list[dict[str, Any]] = self.status()["boards"]
        return next(board for board in boards if board["joint"] == joint)

    def pid(self, word: str) -> int:
        """The child with this word in its command line."""
        return next(pid for pid in children_of(self.launcher.pid) if word in command_line(pid))

    def kill(self) -> None:
        """Leave nobody behind, whatever state the processes are in."""
        for pid in children_of(self.launcher.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
        self.launcher.kill()
        self.launcher.communicate()
