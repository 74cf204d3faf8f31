"""The path of a tick as a group of the bench (`tests.bench.marks`)."""

from functools import partial

from tests.bench.marks import path_of_a_tick
from tests.bench.ours import lockstep
from tests.bench.registry import Contender, Group, Settings


def group(settings: Settings) -> Group:
    """Scenario `paper` in processes, recording off."""
    play = partial(lockstep, settings, recorded=False, options={"marks": True}, read=path_of_a_tick)
    title = "the path of a tick along the board that answers last, mean µs"
    return Group("path", title, [Contender("decmesh in processes", play)])
