"""What a process can tell of the machine that it runs on, and of what it has taken from it."""

import resource
import sys
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
TIME_NAMESPACE = Path("/proc/self/ns/time")
KB_BYTES = 1024


class Effort(NamedTuple):
    """What a process has used since it began."""

    cpu_us: int
    """Processor time of all its threads, the system's share included."""
    memory_kb: int
    """The most memory that it has had resident."""


def effort() -> Effort:
    """Ask what this process has used so far."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    # The one number of this call whose unit depends on the system.
    memory_kb = used.ru_maxrss // KB_BYTES if sys.platform == "darwin" else used.ru_maxrss
    return Effort(round((used.ru_utime + used.ru_stime) * 1e6), memory_kb)


def clock_id() -> int:
    """Name the monotonic clock of this process: the same number, the same clock. 0: unknown.

    A clock begins with a boot, and a container may have one of its own. 32 bits.
    """
    try:
        boot = BOOT_ID.read_text()
        namespace = TIME_NAMESPACE.readlink() if TIME_NAMESPACE.is_symlink() else ""
    except OSError:
        return 0
    return int.from_bytes(sha256(f"{boot} {namespace}".encode()).digest()[:4], "little")
