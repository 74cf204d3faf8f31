"""The twin: plant and boards in one process, with frames encoded and decoded."""

import time
from functools import partial

from deploy.scenario import load
from deploy.twin import Twin
from protocol.frames import LinkFrame, Observation, TorqueFrame, decode, encode
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

PLAIN = "twin, frames encoded and decoded"
FRAMES = "its frames alone, each encoded and decoded once"


def group(settings: Settings) -> Group:
    """Three boards on one core."""
    return Group(
        "twin",
        "plant and 3 boards in one process, ticks per second of CPU time",
        [
            Contender(PLAIN, partial(in_twin, settings)),
            Contender(FRAMES, partial(frames_alone, settings)),
        ],
        [Ratio("twin, of its frames alone", PLAIN, FRAMES, "ticks_per_s")],
    )


def frames_alone(settings: Settings) -> Figures:
    """What a tick costs that does nothing but write and read its ten frames."""
    twin = Twin(load("paper"))
    while twin.lockstep.tick < settings.warm_up:
        twin.tick()
    twin.lockstep.begin()
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
