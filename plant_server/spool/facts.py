"""Facts of a run that are not its scenario's: where, when and with what it was run.

    mode            "processes" or "twin"
    started         UTC, ISO 8601
    versions        python, decmesh, zenoh, numpy, msgpack; null for what is not installed
    host            system, kernel, machine, cpu, cores, libc; null for what nobody tells
    clock           names the clock of the wall times, as `protocol.process.machine.clock_id` does
    fingerprint     of the machine's arithmetic, `protocol.process.fingerprint`

At its end a recording adds what the process that wrote it has used, `cpu_s` and `memory_kb`, and in
processes `reports_refused`: how many reports of boards were not kept, by reason.
"""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from protocol.process.fingerprint import fingerprint
from protocol.process.machine import clock_id

CPU_INFO = Path("/proc/cpuinfo")
DISTRIBUTIONS = {
    "decmesh": "decmesh",
    "zenoh": "eclipse-zenoh",
    "numpy": "numpy",
    "msgpack": "msgpack",
}


def facts(mode: str) -> dict[str, Any]:
    """Collect the facts of a run that is about to begin."""
    return {
        "mode": mode,
        "started": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "versions": versions(),
        "host": host(),
        "clock": clock_id(),
        "fingerprint": fingerprint(),
    }


def versions() -> dict[str, str | None]:
    """Versions of what a trajectory depends on; None for what is not installed."""
    from importlib import metadata  # noqa: PLC0415 - 30 ms, a third of what a plant's start takes

    found: dict[str, str | None] = {"python": platform.python_version()}
    for name, distribution in DISTRIBUTIONS.items():
        try:
            found[name] = metadata.version(distribution)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def host() -> dict[str, str | int | None]:
    """What kind of machine this is, but not whose."""
    return {
        "system": platform.system(),
        "kernel": platform.release(),
        "machine": platform.machine(),
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "libc": " ".join(platform.libc_ver()).strip() or None,
    }


def _cpu() -> str | None:
    """Model name of the processor (Linux)."""
    try:
        lines = CPU_INFO.read_text().splitlines()
    except OSError:
        return None
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, None)
