"""One joint board on its own clock: the same firmware, at its own rate, waiting for nobody.

    board.observe(payload)          whenever an observation arrives
    board.hear(link, payload)       whenever a frame of a neighbour does
    actuation = board.play(slot)    once a period, with what there is

Rule 1: inside, a tick is an own period (a slot); `OwnTime` translates.
Rule 2: slots only go on, but may leap. Between two observations the latest one holds.
Rule 3: commands are obeyed in the next slot, also those in observations that have been overtaken.
Rule 4: what a slot does follows from what was observed and heard before it, and from its number;
        not from any clock. `used` says what that was, and a replay needs no more (S24).
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.firmware.board import Actuation, AnsweredError, Board
from module_agent.firmware.election import NOTHING_MARKED
from module_agent.firmware.own_time.mailbox import Mailbox
from module_agent.firmware.own_time.translator import OwnTime
from protocol.wire.frames import NO_TICK, Neighbour, Observation, ProtocolError, Reason
from protocol.wire.trace import LastWord, Mark, TakenFrames


class SlotInputs(NamedTuple):
    """What a slot was played with."""

    seen_tick: int
    taken: tuple[TakenFrames, ...]
    marks: Mark


class OwnTimeBoard:
    """A board, its translator, and what has arrived for its next slot."""

    def __init__(self, board: Board, own_time: OwnTime, mailboxes: Sequence[Mailbox]) -> None:
        self.board = board
        self.own_time = own_time
        self.last_words: list[LastWord] = []
        """What was heard last of neighbours that are gone, for whoever drives this to tell."""
        self._mailboxes = mailboxes
        self._latest: Observation | None = None
        self._commands: list[bytes] = []
        self._there: tuple[int, ...] = ()
        """Incarnations of the neighbours in the last slot."""

    @property
    def seen_tick(self) -> int:
        """The plant's tick of the latest observation; `NO_TICK` before the first."""
        return NO_TICK if self._latest is None else self._latest.tick

    def observe(self, payload: bytes) -> None:
        """Take an observation.

        Raises `ProtocolError`, `ReplacedError` when it is not for this incarnation, or
        `AnsweredError` when it is the latest one again.
        """
        observation = self.board.read_any(payload)
        if observation.tick == self.seen_tick:
            raise AnsweredError
        if observation.tick < self.seen_tick:
            raise ProtocolError(Reason.TICK, f"tick {observation.tick} has been overtaken")
        self.board.check_roster(observation)
        self._latest = observation
        if observation.command:
            self._commands.append(observation.command)

    def hear(self, link: int, payload: bytes) -> int:
        """Take a frame of a link, as `Board.hear`."""
        return self.board.hear(link, payload)

    def play(self, slot: int) -> Actuation:
        """Go through one own period; they come in order, but some may be left out."""
        board, latest = self.board, self._latest
        assert latest is not None, "the loop begins with an observation"
        assert board.next_tick is None or slot >= board.next_tick
        for command in self._commands:
            board.obey(command)
        self._commands.clear()
        self._collect_last_frames(latest.neighbours)
        return board.step(slot, self.own_time.round(slot), self.own_time.observation(latest))

    @property
    def used(self) -> SlotInputs:
        """What the last slot was played with."""
        taken = tuple(mailbox.taken for mailbox in self._mailboxes)
        election = self.board.election
        marks = NOTHING_MARKED if election is None else election.marks
        return SlotInputs(self.seen_tick, taken, marks)

    def _collect_last_frames(self, roster: tuple[Neighbour, ...]) -> None:
        """Keep the last frames of neighbours that have left the roster."""
        there = tuple(neighbour.incarnation for neighbour in roster)
        if there == self._there:
            return
        board = self.board
        for link, (before, now) in enumerate(zip(self._there, there, strict=False)):
            if before not in (0, now):
                sender, mailbox = board.config.neighbours[link], self._mailboxes[link]
                self.last_words += [
                    LastWord(board.run_id, board.incarnation, sender, frame)
                    for frame in mailbox.kept
                ]
                mailbox.kept.clear()
        self._there = there
