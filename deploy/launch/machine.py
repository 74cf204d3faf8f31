"""What this machine has: cores and memory."""

import os
from contextlib import suppress
from pathlib import Path

MEGABYTE = 1_000_000
_MEMORY = Path("/proc/meminfo")


def cores() -> int:
    """How many processes can run at the same time."""
    with suppress(AttributeError):  # Linux: those that this process may use.
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_memory_mb() -> int | None:
    """Memory that new processes can have; None where the system does not tell."""
    with suppress(OSError):
        for line in _MEMORY.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024 // MEGABYTE
    with suppress(ValueError, OSError):
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // MEGABYTE
    return None
