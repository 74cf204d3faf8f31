"""How cost grows with the number of boards: each a process, and all in one."""

import statistics
import time
from functools import cache, partial

from deploy.launch.twin import Twin
from tests.bench.hanging import hanging
from tests.bench.ours import lockstep
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

PROCESSES = (3, 5, 10, 20)
IN_TWIN = (3, 10, 30, 100, 300, 1000)
BLOCK_BOARD_TICKS = 3000
"""How much is played at a time, so that all sizes are measured for about as long."""
BLOCKS = 3


def processes(settings: Settings) -> Group:
    """Every board a process, however few cores there are."""
    ticks = settings._replace(warm_up=settings.warm_up // 5, ticks=settings.ticks // 5)

    def play(boards: int) -> Figures:
        scenario = hanging(boards, ticks=ticks.warm_up + ticks.ticks)
        figures = lockstep(ticks, recorded=False, scenario=scenario)
        return {"us_per_board": 1e6 / figures["ticks_per_s"] / boards, **figures}

    return Group(
        "processes",
        "a hanging chain, every board a process, µs per board and tick",
        [Contender(f"{boards} boards", partial(play, boards)) for boards in PROCESSES],
        [Ratio("20 boards, of 3, per board", "20 boards", "3 boards", "us_per_board")],
    )


def in_twin(settings: Settings) -> Group:
    """All boards in one process, on one core."""
    sizes = [boards for boards in IN_TWIN if boards <= settings.boards_max]

    @cache
    def swinging(boards: int) -> Twin:
        """A robot whose delay lines are full; kept, because they take long to fill."""
        twin = Twin(hanging(boards))
        for record in twin.run():
            if record.tick == 0:
                return twin
        raise AssertionError("it hangs for ever")

    def play(boards: int) -> Figures:
        twin, costs = swinging(boards), []
        ticks = max(1, BLOCK_BOARD_TICKS // boards)
        for _ in range(BLOCKS):
            end = twin.lockstep.plant.tick + ticks
            started = time.process_time()
            for record in twin.run():
                if record.tick == end:
                    break
            costs.append(1e6 * (time.process_time() - started) / (ticks + 1) / boards)
        return {"us_per_board": statistics.median(costs)}

    largest = f"{sizes[-1]} boards"
    return Group(
        "growth",
        "a hanging chain in the twin, CPU µs per board and tick",
        [Contender(f"{boards} boards", partial(play, boards)) for boards in sizes],
        [Ratio(f"{largest}, of 10, per board", largest, "10 boards", "us_per_board")],
    )
