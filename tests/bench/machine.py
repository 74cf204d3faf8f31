"""On what and with what was measured: without it a number means nothing."""

import os
import platform
import subprocess
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from protocol.process.compiled import compiled

LIBRARIES = (
    "decmesh", "eclipse-zenoh", "msgpack", "numpy", "scipy", "mujoco", "pin", "pyzmq", "lcm",
    "cyclonedds", "paho-mqtt", "dora-rs", "helics",
)  # fmt: skip


def machine() -> dict[str, Any]:
    """Processor, system, versions and time."""
    return {
        "when": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "commit": _commit(),
        "processor": processor(),
        "cores": len(os.sched_getaffinity(0)),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "control_loop": "compiled" if any(compiled()) else "interpreted",
        "versions": {name: found for name in LIBRARIES if (found := _version(name))},
    }


def processor() -> str:
    """Name of the processor (Linux), or what Python knows of it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _commit() -> str:
    """The commit that was measured, with a `+` when files have been changed since."""
    command = ["git", "describe", "--always", "--dirty=+"]
    found = subprocess.run(
        command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return found.stdout.strip()
