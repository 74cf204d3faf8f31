"""The machine that robots run on: its cores, its memory, and which process runs on which core.

A tick goes from the plant to its boards and back. Left alone, the kernel wakes each of them where
there is room at that moment, often on another core than before, where its caches are cold. Placed,
neighbours think at the same time, each in its own place.
"""

import psutil

MEGABYTE = 1_000_000


def cores() -> int:
    """How many processes can run at the same time."""
    return len(_own_cores()) or psutil.cpu_count() or 1


def free_memory_mb() -> int:
    """Memory that new processes can have."""
    available: int = psutil.virtual_memory().available
    return available // MEGABYTE


def place(process: int, role: int, roles: int) -> None:
    """Give a process its core: plant and boards, from the ground up, in turn.

    Nothing happens where there is a core for each, or one for all, or no such thing as placing.
    """
    own = _own_cores()
    if 1 < len(own) < roles:
        try:
            psutil.Process(process).cpu_affinity([own[role % len(own)]])
        except (
            psutil.Error,
            OSError,
        ):  # It has ended, or may not be placed: it runs anywhere.
            return


def _own_cores() -> list[int]:
    """Those that this process may use; none where the system knows no such thing (macOS)."""
    this = psutil.Process()
    return sorted(this.cpu_affinity()) if hasattr(this, "cpu_affinity") else []
