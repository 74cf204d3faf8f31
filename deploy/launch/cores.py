"""Cores: where the processes of a robot run when there are more of them than cores.

A tick goes from the plant to its boards and back. Left alone, the kernel wakes each of them where
there is room at that moment, often on another core than before, where its caches are cold. Placed,
neighbours think at the same time, each in its own place.
"""

import os


def place(process: int, role: int, roles: int) -> None:
    """Give a process its core: plant and boards, from the ground up, in turn.

    Nothing happens where there is a core for each, or one for all, or no such thing as placing.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if 1 < len(cores) < roles:
        try:
            os.sched_setaffinity(process, {cores[role % len(cores)]})
        except OSError:  # It has ended already, or a container forbids it: it runs anywhere.
            return
