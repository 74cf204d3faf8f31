"""Knobs of a process: what can be turned without changing what it says.

switch_interval_s   how long a Python thread may keep the interpreter when another wants it
runtime             threads of Zenoh, as ZENOH_RUNTIME says it
cores               which core each role may use: "one", "plant-apart", "in-turn" (as `decmesh run`
                    has it where there are fewer cores than roles) or "any"
batch               true: SCHED_BATCH, under which who is woken does not push others aside
realtime            true: SCHED_FIFO (needs the right to)
"""

import os
import sys
from typing import Any

from deploy.launch.machine import place


def turn(options: dict[str, Any], role: int, roles: int) -> None:
    """Set up this process; what it starts later takes over cores and policy."""
    if "runtime" in options:
        os.environ["ZENOH_RUNTIME"] = options["runtime"]
    if "switch_interval_s" in options:
        sys.setswitchinterval(options["switch_interval_s"])
    layout = options.get("cores", "any")
    if layout == "in-turn":
        place(0, role, roles)
    elif layout != "any":
        os.sched_setaffinity(0, cores(layout, role, sorted(os.sched_getaffinity(0))))
    if options.get("batch"):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    if options.get("realtime"):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))


def cores(layout: str, role: int, there: list[int]) -> set[int]:
    """The cores of a role, 0 being the plant, out of those that there are."""
    first, rest = there[:1], there[1:] or there
    if layout == "one":
        return set(first)
    assert layout == "plant-apart", layout
    return set(first if role == 0 else rest)
