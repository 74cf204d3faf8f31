"""Which robots are running on this machine, and which ports are theirs (S3).

Rule 1: a robot holds a lock on its rig file for as long as it runs. A file that nobody holds is
        left over from a launcher that was killed, and means nothing.
Rule 2: one launcher at a time comes or goes (a lock on the folder), and it passes over the ports
        of every robot that is there, opened or not. So two launchers never race for the same.
"""

import fcntl
import json
import os
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from msgspec.structs import asdict, replace

from protocol.robot.scenario import RigSettings, Scenario

PORTS_APART = 32
RIGS_MAX = 200
PORT_MAX = 65_535


class NoPortsError(Exception):
    """No range of ports is free for a robot."""


def folder() -> Path:
    """Where this user's rig files are."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    parent = Path(runtime) / "decmesh" if runtime else _fallback_folder()
    parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    return parent


@contextmanager
def claim(scenario: Scenario, run_folder: Path) -> Iterator[Scenario]:
    """Reserve ports for a robot, starting with those that its scenario names.

    Yields the scenario with the ports that it got. Raises `NoPortsError`.
    """
    rig, ports = scenario.rig, len(scenario.boards) + 1
    with claim_ports(rig, ports, run_folder, name=scenario.name) as base_port:
        yield replace(scenario, rig=replace(rig, base_port=base_port))


@contextmanager
def claim_ports(rig: RigSettings, count: int, run_folder: Path, *, name: str) -> Iterator[int]:
    """Reserve so many ports in a row, the first of which this yields. Raises `NoPortsError`.

    `name`: of what is run, for whoever looks at what there is.
    """
    with _alone():
        base_port = _free_base_port(rig, count)
        path = folder() / f"{base_port}.json"
        file = path.open("a+")
        assert _lock(file.fileno()), "nobody else is choosing, and nobody has these ports"
        about = {**asdict(rig), "base_port": base_port, "ports": count, "pid": os.getpid()}
        _describe(file, {**about, "scenario": name, "run": str(run_folder.resolve())})
    with file:
        try:
            yield base_port
        finally:
            with _alone():
                path.unlink(missing_ok=True)


@contextmanager
def _alone() -> Iterator[None]:
    """Keep other launchers from choosing ports meanwhile."""
    descriptor = os.open(folder(), os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _free_base_port(rig: RigSettings, count: int) -> int:
    first = rig.base_port
    last = min(PORT_MAX - count + 1, first + (RIGS_MAX - 1) * max(PORTS_APART, count))
    taken = set(_ports_of_rigs())
    for base_port in range(first, last + 1, max(PORTS_APART, count)):
        ports = range(base_port, base_port + count)
        if taken.isdisjoint(ports) and _all_free(rig.host, ports):
            return base_port
    raise NoPortsError(
        f"no {count} free ports in a row on {rig.host} from {first} on;"
        f" end other runs, or set rig.base_port"
    )


def _ports_of_rigs() -> Iterator[int]:
    """Ports of all robots that run, whether they have opened them yet or not."""
    for path in folder().glob("*.json"):
        with path.open("r+") as file:
            if _lock(file.fileno()):
                continue
            base_port, count = int(path.stem), PORTS_APART
            with suppress(ValueError, KeyError):  # Else another version's: it says less.
                count = json.load(file)["ports"]
            yield from range(base_port, base_port + count)


def running() -> list[dict[str, Any]]:
    """What is known of each robot that runs: name, host, base_port, scenario, run, pid."""
    found = []
    for path in sorted(folder().glob("*.json")):
        with suppress(OSError, ValueError), path.open("r+") as file:
            if not _lock(file.fileno()):  # Somebody holds it, so it means something.
                found.append(json.loads(path.read_text()))
    return found


def _describe(file: Any, about: dict[str, Any]) -> None:
    file.truncate(0)
    json.dump(about, file)
    file.flush()


def _fallback_folder() -> Path:
    return Path(tempfile.gettempdir()) / f"decmesh-{os.getuid()}"


def _lock(descriptor: int) -> bool:
    with suppress(BlockingIOError):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _all_free(host: str, ports: range) -> bool:
    for port in ports:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
            except OSError:
                return False
    return True
