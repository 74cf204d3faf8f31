"""The agenda: what is to happen to the robot, in order, at most one command a tick (S15).

Rule: a command is due at its tick or, when others are before it, as soon as they are done.

Besides what scenarios and terminals say, the plant itself puts down `Ready`: the board that was
plugged in a while ago has started up. Until then it is nobody: not on the roster, not waited for,
its joint without a driver. The while is counted in ticks, so it is the same however long the
process really takes. The boards with which a run begins have started up when they enrol.
"""

from bisect import bisect, insort
from typing import NamedTuple

from plant_server.session.config import PlantConfig
from protocol.robot.clocks import Clock
from protocol.robot.events import Plug, Ready, Scheduled


class Entry(NamedTuple):
    """A command and when it is due; entries of one tick keep the order in which they came."""

    tick: int
    number: int
    command: Scheduled


class Agenda:
    """Commands that have yet to be carried out."""

    def __init__(self, scheduled: list[tuple[int, Scheduled]]) -> None:
        self._entries: list[Entry] = []
        self._number = 0
        for tick, command in scheduled:
            self.add(tick, command)

    def add(self, tick: int, command: Scheduled) -> None:
        """Schedule a command for a tick."""
        insort(self._entries, Entry(tick, self._number, command))
        self._number += 1

    def turn(self, tick: int) -> int:
        """The tick in which a command would be carried out that is added for the next one."""
        return tick + bisect(self._entries, tick, key=lambda entry: entry.tick)

    def expects_plug(self, board: int) -> bool:
        """Whether a board is to be put in later; until then it has to wait."""
        return self.holds(Plug(board)) or self.holds(Ready(board))

    def holds(self, command: Scheduled) -> bool:
        """Whether a command has yet to be carried out."""
        return any(entry.command == command for entry in self._entries)

    def cancel(self, command: Scheduled) -> None:
        """Take a command off the agenda."""
        self._entries = [entry for entry in self._entries if entry.command != command]

    def due(self, tick: int) -> Scheduled | None:
        """Take the command of this tick, if there is one."""
        if self._entries and self._entries[0].tick <= tick:
            return self._entries.pop(0).command
        return None


class StartUp:
    """Turns the plugging of boards into their admission, now or later."""

    def __init__(self, config: PlantConfig, agenda: Agenda) -> None:
        self._agenda = agenda
        self._clocks = [
            Clock(sheet, seed=config.run.seed, board=board, tick_s=config.run.tick_s)
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
