"""The twin: plant and boards in one process, with frames encoded and decoded."""

import json
import subprocess
import sys
import time
from functools import partial

from deploy.launch.twin import Twin
from deploy.scenario_file.load import load
from protocol.wire.frames import LinkFrame, Observation, TorqueFrame, decode, encode
from tests.bench.compiled import compiled_copy
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

PLAIN = "twin, frames encoded and decoded"
COMPILED = "twin, compiled"
FRAMES = "its frames alone, each encoded and decoded once"


def group(settings: Settings) -> Group:
    """Three boards on one core."""
    return Group(
        "twin",
        "plant and 3 boards in one process, ticks per second of CPU time",
        [
            Contender(PLAIN, partial(in_twin, settings)),
            Contender(COMPILED, partial(in_compiled_twin, settings)),
            Contender(FRAMES, partial(frames_alone, settings)),
        ],
        [
            Ratio("twin, of its frames alone", PLAIN, FRAMES, "ticks_per_s"),
            Ratio("twin, compiled, of interpreted", COMPILED, PLAIN, "ticks_per_s"),
        ],
    )


def frames_alone(settings: Settings) -> Figures:
    """What a tick costs that does nothing but write and read its ten frames."""
    twin = Twin(load("paper"))
    while twin.lockstep.plant.tick < settings.warm_up:
        twin.tick()
    twin.lockstep.plant.begin()
    kinds: list[tuple[type[Observation | LinkFrame | TorqueFrame], bytes]] = []
    for index, payload in twin.lockstep.open():
        board = twin.boards[index]
        assert board is not None
        actuation = board.tick(board.read(payload))
        kinds += [(Observation, payload), (TorqueFrame, actuation.torque)]
        kinds += ((LinkFrame, link) for link in actuation.links)
    frames = [(kind, decode(kind, payload)) for kind, payload in kinds]
    started_s = time.process_time()
    for _ in range(settings.ticks):
        for kind, frame in frames:
            decode(kind, encode(frame))
    return {"ticks_per_s": settings.ticks / (time.process_time() - started_s)}


def in_twin(settings: Settings) -> Figures:
    """Play a run; its rate after the ticks that do not count."""
    scenario = load("paper", [f"run.duration_s={(settings.warm_up + settings.ticks) / 1000}"])
    started_s = 0.0
    for record in Twin(scenario).run():
        if record.tick == settings.warm_up:
            started_s = time.process_time()
    ticks = settings.ticks - 1  # The first is over when the clock starts.
    return {"ticks_per_s": ticks / (time.process_time() - started_s)}


def in_compiled_twin(settings: Settings) -> Figures:
    """The same, with the control loop in C, in a process of its own."""
    command = [sys.executable, "-m", "tests.bench.twin", json.dumps(settings)]
    told = subprocess.run(command, cwd=compiled_copy(), capture_output=True, check=True).stdout
    figures: Figures = json.loads(told)
    return figures


if __name__ == "__main__":
    print(json.dumps(in_twin(Settings(*json.loads(sys.argv[1])))))
