"""What a process can tell of the machine that it runs on, and of what it has taken from it."""

import resource
import sys
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
TIME_NAMESPACE = Path("/proc/self/ns/time")
STATUS = Path("/proc/self/status")
KB_BYTES = 1024
MEMORY_EVERY = 50


class Effort(NamedTuple):
    """What a process has used since it began."""

    cpu_us: int
    """Processor time of all its threads, the system's share included."""
    memory_kb: int
    """The most memory that it has had resident."""


class EffortMeter:
    """Asks the system what this process has used; after its memory, which takes long, seldom."""

    def __init__(self) -> None:
        self._readings = 0
        self._memory_kb = 0

    def read(self) -> Effort:
        """What has been used so far, memory as of at most `MEMORY_EVERY` readings ago."""
        used = resource.getrusage(resource.RUSAGE_SELF)
        if self._readings % MEMORY_EVERY == 0:
            self._memory_kb = _memory_kb(used)
        self._readings += 1
        return Effort(round((used.ru_utime + used.ru_stime) * 1e6), self._memory_kb)


def _memory_kb(used: resource.struct_rusage) -> int:
    """The most resident memory of this program.

    Linux counts in `ru_maxrss` what the process had before it became this program: that of the one
    which started it. `VmHWM` begins with the program.
    """
    with suppress(OSError, ValueError, StopIteration), STATUS.open(encoding="ascii") as lines:
        return int(next(line for line in lines if line.startswith("VmHWM:")).split()[1])
    # The one number of this call whose unit depends on the system.
    return used.ru_maxrss // KB_BYTES if sys.platform == "darwin" else used.ru_maxrss


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
