"""Which knob helps: a run with one thing turned, each right after a run without.

So a ratio is of two runs that have seen the machine in the same mood. What the knobs are is said in
`tests.bench.knobs` and `tests.bench.peers.bare_zenoh`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from tests.bench.ours import lockstep
from tests.bench.registry import Contender, Figures, Group, Settings
from tests.bench.systems import OUR_SETTINGS, do_job

Play = Callable[[dict[str, Any]], Figures]
ONE_RUNTIME = (
    "(rx:(worker_threads:{}),net:(handover:rx),acc:(handover:rx),"
    "app:(handover:rx),tx:(handover:rx))"
)
PROCESS: dict[str, dict[str, Any]] = {
    "all on one core": {"cores": "one"},
    "plant on one core, boards on the other": {"cores": "plant-apart"},
    "roles on any core": {"cores": "any"},
    "SCHED_BATCH": {"batch": True},
    "SCHED_BATCH, all on one core": {"batch": True, "cores": "one"},
    "SCHED_FIFO": {"realtime": True},
    "SCHED_FIFO, all on one core": {"realtime": True, "cores": "one"},
    "GIL switch interval 0.1 ms": {"switch_interval_s": 1e-4},
    "GIL switch interval 50 ms": {"switch_interval_s": 0.05},
}
TRANSPORT: dict[str, dict[str, Any]] = {
    "Zenoh's own runtime threads": {"runtime": "()"},
    "one runtime, one thread": {"runtime": ONE_RUNTIME.format(1)},
    "one runtime, two threads": {"runtime": ONE_RUNTIME.format(2)},
    "one runtime, two threads, unixsock-stream": {
        "runtime": ONE_RUNTIME.format(2),
        "link": "unixsock-stream",
    },
    "without lowlatency": {"lowlatency": False},
    "unixsock-stream": {"link": "unixsock-stream"},
}
BARE: dict[str, dict[str, Any]] = {
    "callback into a queue": {"hear": "queue"},
    "not express": {"express": False},
    "observations in one put": {"observations": "one"},
    "a board's frames in one put": {"boards": "one"},
    "both in one put": {"observations": "one", "boards": "one"},
}


def bare(settings: Settings) -> Group:
    """Bare Zenoh with the settings of decmesh, but for one."""

    def play(options: dict[str, Any]) -> Figures:
        return do_job(OUR_SETTINGS, warm_up=settings.warm_up, ticks=settings.ticks, options=options)

    return _group(
        "knobs-bare",
        "bare Zenoh, one knob turned, ticks/s of those without",
        play,
        PROCESS | TRANSPORT | BARE,
    )


def ours(settings: Settings) -> Group:
    """decmesh, recording off."""

    def play(options: dict[str, Any]) -> Figures:
        return lockstep(settings, recorded=False, options=options)

    return _group(
        "knobs", "decmesh, one knob turned, ticks/s of those without", play, PROCESS | TRANSPORT
    )


def _group(name: str, title: str, play: Play, knobs: dict[str, dict[str, Any]]) -> Group:
    def beside_plain(options: dict[str, Any]) -> Figures:
        plain, turned = play({}), play(options)
        return {"ratio": turned["ticks_per_s"] / plain["ticks_per_s"], **turned}

    return Group(
        name,
        title,
        [Contender(knob, partial(beside_plain, options)) for knob, options in knobs.items()],
    )
