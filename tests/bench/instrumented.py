"""One process of decmesh that also measures itself: its CPU time, and at the plant every tick.

    python -m tests.bench.instrumented FOLDER ROLE MODULE ARGUMENT ...

The program is the one that a user runs. Only the ends of its ticks are watched from here, through
`Console.show` and `BoardTiming.ticked`, which are never compiled, and some settings of the
transport can be others (`Place`):

    lowlatency      false: with priorities and fragmentation
    link            "unixsock-stream" instead of tcp

With the option `marks`, it also notes when it is where (`tests.bench.marks`).
"""

import runpy
import sys
import time
from pathlib import Path
from typing import Any
from unittest.mock import patch

import protocol.wire.wiring
from module_agent.firmware.timing import BoardTiming
from plant_server.process.console import Console
from protocol.wire.wiring import Rig
from tests.bench import knobs
from tests.bench.job import PLANT, Place, tick_figures, write_figures
from tests.bench.marks import Marks

MODULES = ("plant_server", "module_agent")


class Watch:
    """CPU time from the first tick that counts to the last, and when each ended."""

    def __init__(self, place: Place) -> None:
        self.first, self.last = place.warm_up, place.warm_up + place.ticks - 1
        self.cpu_s = 0.0
        self.stamps_ns: list[int] = []

    def end_of_tick(self, tick: int) -> None:
        """Note that a tick is over."""
        if tick >= self.first - 1:
            self.stamps_ns.append(time.perf_counter_ns())
        if tick == self.first - 1:
            self.cpu_s = -time.process_time()
        elif tick == self.last:
            self.cpu_s += time.process_time()


def main() -> None:
    """Run a program of decmesh, and write down what it took."""
    folder, role, module = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    place = Place.read(folder)
    knobs.turn(place.options, role, 1 + place.boards)
    _set_transport(place)
    marks = Marks(role) if place.options.get("marks") else None
    watch = Watch(place)
    _watch_plant(watch) if role == PLANT else _watch_board(watch)
    assert module in MODULES
    sys.argv = [module, *sys.argv[4:]]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    finally:
        if marks is not None:
            marks.write(place, role)
        about_ticks = tick_figures(watch.stamps_ns) if role == PLANT else {}
        write_figures(place, role, {"cpu_s": watch.cpu_s, **about_ticks})


def _watch_plant(watch: Watch) -> None:
    show = Console.show

    def shown(console: Console, tick: int, released_s: float | None) -> None:
        show(console, tick, released_s)
        watch.end_of_tick(tick)

    patch.object(Console, "show", shown).start()


def _watch_board(watch: Watch) -> None:
    ticked = BoardTiming.ticked

    def noted(timing: BoardTiming, tick: int, *stamps_ns: int) -> None:
        ticked(timing, tick, *stamps_ns)
        watch.end_of_tick(tick)

    patch.object(BoardTiming, "ticked", noted).start()


def _set_transport(place: Place) -> None:
    """Change what `protocol.wire.wiring` says of the transport."""
    options, config_of = place.options, protocol.wire.wiring._config

    def config(**about: Any) -> dict[str, Any]:
        found = config_of(**about)
        if options.get("lowlatency") is False:
            unicast = found["transport"]["unicast"]
            del unicast["lowlatency"], unicast["qos"]
        return found

    def endpoint(rig: Rig, port_offset: int) -> str:
        return f"unixsock-stream/{place.folder}/zenoh-{rig.base_port + port_offset}"

    patch.object(protocol.wire.wiring, "_config", config).start()
    if options.get("link") == "unixsock-stream":
        patch.object(Rig, "endpoint", endpoint).start()


if __name__ == "__main__":
    main()
