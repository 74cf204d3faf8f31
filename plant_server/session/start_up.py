"""Start-up: a board that is plugged in takes a while before it is there.

Rule 1: until then it is nobody: not on the roster, not waited for, its joint without a driver.
Rule 2: the while is counted in ticks, and ends with an entry of the agenda, `Ready`. So it is
        the same however long the process really takes.

The boards with which a run begins have started up when they enrol.
"""

from plant_server.session.agenda import Agenda
from plant_server.session.config import PlantConfig
from protocol.robot.clocks import Clock
from protocol.robot.events import Plug, Ready


class StartUp:
    """Turns the plugging of boards into their admission, now or later."""

    def __init__(self, config: PlantConfig, agenda: Agenda) -> None:
        self._agenda = agenda
        self._clocks = [
            Clock(sheet, seed=config.seed, board=board, tick_s=config.tick_s)
            for board, sheet in enumerate(config.clock_sheets)
        ]

    def plug(self, board: int, tick: int, *, present: bool) -> Plug | None:
        """What is to be done at once about a board that is plugged in; None: nothing yet."""
        if self.under_way(board):
            return None
        ticks = self._clocks[board].start_up_ticks(tick) if self._clocks else 0
        if ticks == 0 or present:
            return Plug(board)
        self._agenda.add(tick + ticks, Ready(board))
        return None

    def unplug(self, board: int) -> None:
        """It will not be there after all."""
        self._agenda.cancel(Ready(board))

    def under_way(self, board: int) -> bool:
        """Whether a board is starting up."""
        return self._agenda.holds(Ready(board))
