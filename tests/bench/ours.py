"""decmesh in processes, beside bare Zenoh with the same messages and nothing computed."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from deploy.launch.rigs import claim
from deploy.scenario_file.load import load
from protocol.robot.scenario import Scenario, canonical
from tests.bench.children import Children
from tests.bench.compiled import compiled_copy
from tests.bench.job import Place, job_figures
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings
from tests.bench.systems import AS_IT_COMES, OUR_SETTINGS, UNPLACED, System, do_job

OFF, ON = "decmesh in processes, recording off", "decmesh in processes, everything on"
COMPILED = "decmesh in processes, recording off, compiled"


class Rig(NamedTuple):
    """Where plant and boards are started."""

    place: Place
    scenario: Scenario
    children: Children
    instrumented: bool
    """Whether they measure their ticks; what starting costs is measured without."""

    def start_board(self, joint: str, name: str | None = None) -> None:
        """Start the process of a board."""
        words = ["--scenario", str(self.place.folder / "scenario.json"), "--lifeline"]
        role = 1 + self.scenario.joints.index(joint)
        self._start(name or joint, role, "module_agent", joint, *words)

    def start_plant(self, *options: str) -> None:
        """Start the plant."""
        words = ["--scenario", str(self.place.folder / "scenario.json"), "--lifeline", *options]
        self._start("plant", 0, "plant_server", *words)

    def _start(self, name: str, role: int, module: str, *words: str) -> None:
        about = ["tests.bench.instrumented", str(self.place.folder), str(role)]
        command = [sys.executable, "-m", *(about if self.instrumented else []), module, *words]
        where = compiled_copy() if self.place.options.get("compiled") else None
        self.children.start(name, command, where=where)


def as_run(options: dict[str, Any] | None) -> dict[str, Any]:
    """What `decmesh run` does with processes, unless something else is to be measured."""
    return {"cores": "in-turn", **(options or {})}


@contextmanager
def rig(
    scenario: Scenario,
    *,
    warm_up: int = 0,
    ticks: int = 0,
    options: dict[str, Any] | None = None,
) -> Iterator[Rig]:
    """Ports and a folder for a robot, instrumented if it has ticks to count; nothing runs yet."""
    with (
        TemporaryDirectory(prefix="decmesh-bench-") as name,
        claim(scenario, Path(name)) as placed,
        Children(Path(name)) as children,
    ):
        port = placed.rig.base_port
        place = Place(Path(name), port, len(placed.joints), warm_up, ticks, as_run(options))
        place.write()
        (place.folder / "scenario.json").write_bytes(canonical(placed))
        yield Rig(place, placed, children, instrumented=ticks > 0)


def lockstep(
    settings: Settings,
    *,
    recorded: bool,
    options: dict[str, Any] | None = None,
    scenario: Scenario | None = None,
    within_s: float = 100.0,
    read: Callable[[Place], Figures] = job_figures,
) -> Figures:
    """Play a run with every board a process; tell what `read` finds in its folder."""
    ticks = settings.warm_up + settings.ticks
    scenario = scenario or load("paper", [f"run.duration_s={ticks / 1000}"])
    with rig(scenario, warm_up=settings.warm_up, ticks=settings.ticks, options=options) as started:
        spool = ["--spool", str(started.place.folder / "run.spool")] if recorded else []
        started.start_plant(*spool)
        for joint in scenario.joints:
            started.start_board(joint)
        started.children.wait(["plant", *scenario.joints], within_s)
        return read(started.place)


def group(settings: Settings) -> Group:
    """What the control of a robot costs beyond its messages."""

    def bare(system: System) -> Callable[[], Figures]:
        return partial(do_job, system, warm_up=settings.warm_up, ticks=settings.ticks)

    return Group(
        "decmesh",
        "plant and 3 boards, a process each, ticks/s",
        [
            Contender(AS_IT_COMES.name, bare(AS_IT_COMES)),
            Contender(UNPLACED.name, bare(UNPLACED)),
            Contender(OUR_SETTINGS.name, bare(OUR_SETTINGS)),
            Contender(OFF, partial(lockstep, settings, recorded=False)),
            Contender(
                COMPILED, partial(lockstep, settings, recorded=False, options={"compiled": True})
            ),
            Contender(ON, partial(lockstep, settings, recorded=True)),
        ],
        [
            Ratio("recording off, of bare Zenoh as it comes", OFF, AS_IT_COMES.name, "ticks_per_s"),
            Ratio(f"recording off, of {UNPLACED.name}", OFF, UNPLACED.name, "ticks_per_s"),
            Ratio(
                "recording off, of bare Zenoh, our settings", OFF, OUR_SETTINGS.name, "ticks_per_s"
            ),
            Ratio(
                "compiled, of bare Zenoh, our settings", COMPILED, OUR_SETTINGS.name, "ticks_per_s"
            ),
            Ratio("compiled, of interpreted", COMPILED, OFF, "ticks_per_s"),
            Ratio(
                "everything on, of bare Zenoh, our settings", ON, OUR_SETTINGS.name, "ticks_per_s"
            ),
            Ratio("everything on, of recording off", ON, OFF, "ticks_per_s"),
        ],
    )
