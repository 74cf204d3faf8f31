"""The single looks of `decmesh doctor`, each at one thing of this machine.

Rule 1: a look leaves nothing behind, ends by itself, and never raises.
Rule 2: `wrong` keeps a robot from running; `mind` does not, but is worth knowing.
Rule 3: what was found is in plain words, and what is not right comes with what to do about it.
"""

import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, metadata, version
from pathlib import Path
from typing import Literal, NamedTuple

import psutil

from deploy.decmesh import packages
from deploy.launch import rigs
from protocol.process.compiled import INTERPRETED, compiled, interpreted

Verdict = Literal["ok", "mind", "wrong"]
ROOT = Path(__file__).parents[2]
MEMORY_MB = 400
"""Of a robot with three boards, its launcher, and figures at the end."""
ECHO_WITHIN_S = 20.0
RESOLUTION_S = 1e-3
NAPS, NAP_S, LATE_S = 15, 1e-3, 5e-3
PROCESSES = ("plant_server", "module_agent", "module_agent.process.elector_runtime")


class Check(NamedTuple):
    """What one look found."""

    about: str
    verdict: Verdict
    found: str
    do: str = ""
    """What to do about it, if it is not ok."""


class Needs(NamedTuple):
    """What the project asks for."""

    python: str
    packages: dict[str, str]
    """The least version of each, by name."""


def needs() -> Needs:
    """Read what `pyproject.toml` asks for; where that is not at hand, what was installed by it."""
    file = ROOT / "pyproject.toml"
    if file.is_file():
        project = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
        python, lines = project["requires-python"], project["dependencies"]
    else:
        about = metadata("decmesh")
        python, lines = about["Requires-Python"], about.get_all("Requires-Dist") or []
    found = [re.match(r"([\w.-]+)\s*>=\s*([\w.]+)", line) for line in lines if "extra" not in line]
    return Needs(python.removeprefix(">="), {match[1]: match[2] for match in found if match})


def python(wanted: str, found: str) -> Check:
    """Whether this Python is new enough."""
    if _numbers(found) >= _numbers(wanted):
        return Check("Python", "ok", found)
    return Check("Python", "wrong", f"{found}, needs {wanted}", f"install Python {wanted} or newer")


def package(name: str, wanted: str, version_of: Callable[[str], str] = version) -> Check:
    """Whether a package is here, and new enough."""
    install = f"pip install '{name}>={wanted}'"
    try:
        found = version_of(name)
    except PackageNotFoundError:
        return Check(name, "wrong", "not installed", install)
    if _numbers(found) >= _numbers(wanted):
        return Check(name, "ok", found)
    return Check(name, "wrong", f"{found}, needs {wanted}", install)


def own_packages() -> Check:
    """Whether no other project's packages stand under the names of ours."""
    for name, place in packages.strangers().items():
        what, _, do = packages.complaint(name, place).partition("; ")
        return Check("own packages", "wrong", what, do)
    return Check("own packages", "ok", ", ".join(packages.NAMES))


def control_loop(root: Path = ROOT) -> Check:
    """Whether what runs in every tick is compiled. It does the same either way."""
    how = "compiled" if any(compiled(root)) else "interpreted; `make compiled` makes it faster"
    if interpreted():
        how = f"interpreted, as {INTERPRETED} asks for"
    return Check("control loop", "ok", how)


def cores(count: int) -> Check:
    """Whether processes can run at the same time."""
    if count > 1:
        return Check("cores", "ok", str(count))
    return Check("cores", "mind", "1", "runs are right but slow: all processes share one core")


def memory(free_mb: int) -> Check:
    """Whether a robot fits into memory."""
    if free_mb >= MEMORY_MB:
        return Check("memory", "ok", f"{free_mb:,} MB free")
    found = f"{free_mb:,} MB free, a robot takes {MEMORY_MB}"
    return Check("memory", "mind", found, "end other programs, or use --twin: one process")


def loopback() -> Check:
    """Whether two sockets on this machine hear each other."""
    try:
        with (
            socket.create_server(("127.0.0.1", 0)) as server,
            socket.create_connection(server.getsockname(), timeout=2.0) as one,
        ):
            server.settimeout(2.0)
            other, _ = server.accept()
            with other:
                other.settimeout(2.0)
                one.sendall(b"?")
                heard = other.recv(1)
    except OSError as error:
        do = "look at the firewall, and whether the loopback interface is up"
        return Check("loopback", "wrong", f"127.0.0.1: {error}", do)
    assert heard == b"?"
    return Check("loopback", "ok", "127.0.0.1 connects")


def ports(wanted: int, free: int, count: int) -> Check:
    """Whether the ports are free that a scenario names, or others near them."""
    last = count - 1
    if free == wanted:
        return Check("ports", "ok", f"{wanted} to {wanted + last} are free")
    found = f"{wanted} to {wanted + last} are taken; decmesh run takes {free} to {free + last}"
    return Check("ports", "mind", found, f"by hand: --set rig.base_port={free} for every process")


def zenoh(host: str, port: int) -> Check:
    """Whether Zenoh carries a message from one session to another, within a bound."""
    command = [sys.executable, "-m", "deploy.launch.zenoh_echo", host, str(port)]
    do = "reinstall it: pip install --force-reinstall eclipse-zenoh"
    try:
        echo = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=ECHO_WITHIN_S
        )
    except subprocess.TimeoutExpired:
        return Check("Zenoh", "wrong", f"no message within {ECHO_WITHIN_S:g} s", do)
    if echo.returncode == 0:
        return Check(
            "Zenoh", "ok", f"a message from session to session took {echo.stdout.strip()} ms"
        )
    said = (echo.stdout + echo.stderr).strip().splitlines() or [f"ended with {echo.returncode}"]
    return Check("Zenoh", "wrong", re.sub(r" at /\S+$", "", said[-1]), do)


def folder(about: str, path: Path, do: str) -> Check:
    """Whether files can be written to a folder, or to where it would be made."""
    there = next(place for place in (path, *path.absolute().parents) if place.exists())
    try:
        with tempfile.TemporaryFile(dir=there):
            return Check(about, "ok", f"{path} can be written")
    except OSError as error:
        return Check(about, "wrong", f"{path}: {error.strerror}", do)


def clock() -> Check:
    """Whether the clock that waits go by is fine enough, and wakes a sleeper in time."""
    resolution_s = time.get_clock_info("monotonic").resolution
    naps_s = []
    for _ in range(NAPS):
        before_s = time.monotonic()
        time.sleep(NAP_S)
        naps_s.append(time.monotonic() - before_s)
    late_s = statistics.median(naps_s) - NAP_S
    if resolution_s > RESOLUTION_S:
        do = "waits cannot be timed; use another system"
        return Check("clock", "wrong", f"steps of {resolution_s * 1e3:g} ms", do)
    found = f"wakes {late_s * 1e3:.2f} ms late"
    if late_s < LATE_S:
        return Check("clock", "ok", found)
    return Check("clock", "mind", found, "runs are right but slow; nothing else should run beside")


def rig_files() -> Check:
    """Whether launchers that were killed have left rig files behind."""
    held = {rig["base_port"] for rig in rigs.running()}
    left = [
        path for path in sorted(rigs.folder().glob("*.json")) if path.stem not in map(str, held)
    ]
    if not left:
        return Check("rig files", "ok", f"none is left over; robots running: {len(held)}")
    found = f"left over by launchers that were killed: {len(left)}"
    return Check("rig files", "mind", found, f"they are ignored; rm {' '.join(map(str, left))}")


def processes() -> Check:
    """Whether boards or plants run that nobody watches any more."""
    left = list(_orphans({rig["pid"] for rig in rigs.running()}))
    if not left:
        return Check("processes", "ok", "none is left over")
    found = f"boards or plants that run on with nobody to watch them: {len(left)}"
    do = f"if you do not need them: kill {' '.join(map(str, left))}"
    return Check("processes", "mind", found, do)


def _orphans(launchers: set[int]) -> Iterator[int]:
    """Our plants and boards whose parent is gone."""
    for process in psutil.process_iter():
        with suppress(psutil.Error, IndexError):
            words, parent = process.cmdline(), process.ppid()
            ours = process.uids().real == os.getuid() and words[1] == "-m"
            if ours and words[2] in PROCESSES and parent == 1 and parent not in launchers:
                yield process.pid


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", text)))
