"""Who is there, and the state of every link as the plant knows it.

Rule 1: the plant alone decides who is there (S6). A joint is driven by one incarnation, or by none.
Rule 2: a board that is put in finds out from the plant what has been changed since the run began.
"""

from collections import deque
from collections.abc import Sequence

from protocol.robot.events import (
    ANY,
    PERFECT,
    BoardCommand,
    LinkCommand,
    LinkOrder,
    LinkParameters,
    ReferenceChange,
    ReferenceOrder,
    concerns,
    encode_board_command,
    parameters_after,
)
from protocol.wire.frames import NO_TICK, Neighbour
from protocol.wire.wiring import neighbours


class Roster:
    """Incarnations, links and references of one body."""

    def __init__(
        self,
        size: int,
        standing: dict[tuple[int, int], LinkParameters],
        references_rad: Sequence[float],
    ) -> None:
        self.size = size
        self.incarnations = [0] * size
        """Who drives each joint; 0: nobody."""
        self.completed_ticks = [NO_TICK] * size
        self.links = {
            (sender, receiver): standing.get((sender, receiver), PERFECT)
            for receiver in range(size)
            for sender in neighbours(receiver, size)
        }
        self.references_rad = list(references_rad)
        self.newcomers: set[int] = set()
        """Boards since the last tick: what was said in it was not said to them."""
        self._at_boot = dict(self.links), list(references_rad)
        self._outboxes: list[deque[bytes]] = [deque() for _ in range(size)]

    def admit(self, board: int, incarnation: int) -> None:
        """Give a joint to a board; an earlier incarnation's frames are void from here on."""
        self.incarnations[board] = incarnation
        self.completed_ticks[board] = NO_TICK
        self.newcomers.add(board)
        self._outboxes[board].clear()
        links, references_rad = self._at_boot
        ours = [(sender, board) for sender in neighbours(board, self.size)]
        self._tell(board, {pair for pair in ours if self.links[pair] != links[pair]})
        if self.references_rad[board] != references_rad[board]:
            self._refer(board)

    def remove(self, board: int) -> None:
        """Take a board off the roster."""
        self.incarnations[board] = 0
        self._outboxes[board].clear()

    def present(self, board: int) -> bool:
        """Whether a joint has a board."""
        return self.incarnations[board] != 0

    def refer(self, command: ReferenceChange) -> None:
        """Give a board another reference."""
        self.references_rad[command.board] = command.reference_rad
        self._refer(command.board)

    def change(self, command: LinkCommand) -> None:
        """Change links."""
        concerned = {pair for pair in self.links if concerns(command, *pair)}
        for pair in concerned:
            self.links[pair] = parameters_after(command, self.links[pair])
        for board in range(self.size):
            self._tell(board, concerned)

    def command_for(self, board: int) -> bytes:
        """What a board is to obey in this tick; the rest waits for the next."""
        outbox = self._outboxes[board]
        return outbox.popleft() if outbox else b""

    def neighbours_of(self, board: int) -> tuple[Neighbour, ...]:
        """The roster as one board sees it: its mechanical neighbours."""
        return tuple(
            Neighbour(
                self.incarnations[other],
                NO_TICK if board in self.newcomers else self.completed_ticks[other],
                1,
            )
            for other in neighbours(board, self.size)
        )

    def sides(self) -> list[list[int]]:
        """The boards that are there, grouped by who can reach whom over links that are not cut."""
        found: list[list[int]] = []
        for board in range(self.size):
            if not self.present(board):
                continue
            below = board - 1
            linked = (
                below >= 0
                and self.present(below)
                and not (self.links[below, board].cut and self.links[board, below].cut)
            )
            if linked:
                found[-1].append(board)
            else:
                found.append([board])
        return found

    def _tell(self, board: int, pairs: set[tuple[int, int]]) -> None:
        """Tell a board how its links are; in one message, if they are all told and all alike."""
        near = neighbours(board, self.size)
        senders = [sender for sender in near if (sender, board) in pairs]
        parameters = [self.links[sender, board] for sender in senders]
        told_all = len(senders) == len(near)
        if len(senders) > 1 and told_all and len(set(parameters)) == 1:
            senders = [ANY]
        for sender, now in zip(senders, parameters, strict=False):
            self._send(board, LinkOrder(sender, now))

    def _refer(self, board: int) -> None:
        self._send(board, ReferenceOrder(self.references_rad[board]))

    def _send(self, board: int, message: BoardCommand) -> None:
        if self.present(board):
            self._outboxes[board].append(encode_board_command(message))
