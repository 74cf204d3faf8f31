"""Replay: plays a recording again in the twin, from what came from outside.

Rule 1: commands, boards that came and went, and frames that were not waited for are taken from the
        recording, tick by tick and in their order. All the rest is computed again: observations,
        link frames, torques, motion.
Rule 2: whatever a run went through, typed by hand or struck by the death of a process, all that
        reached it is in its events. So a replay is the same to the bit, or something is wrong.
"""

from contextlib import redirect_stdout
from io import TextIOBase
from typing import NamedTuple, assert_never

from deploy.launch.twin import Twin
from module_agent.assembly import assemble
from module_agent.firmware.board import Board
from module_agent.firmware.config import board_config
from module_agent.firmware.link_model import Fate, LinkModel
from plant_server.session.record import TickRecord
from protocol.robot.events import (
    Admission,
    BetweenTicks,
    Departure,
    Event,
    EventError,
    Excuse,
    Midway,
    MidwayDeparture,
    Scheduled,
    Why,
    check_event,
)
from protocol.robot.scenario import Scenario
from protocol.wire.frames import Observation, ProtocolError, TorqueFrame, decode

Link = tuple[int, int]
"""A directed link: sender and receiver."""


class DiscardedOutput(TextIOBase):
    """Where a controller from outside prints to in a replay: it has said so already."""

    def write(self, text: str) -> int:
        """Write nothing."""
        return len(text)


NOWHERE = DiscardedOutput()


class UnplayableError(Exception):
    """What a recording says cannot have happened."""


class LinkDraw(NamedTuple):
    """What the link model made of one frame."""

    fate: Fate
    cut: bool
    """Whether the link was cut, so that no chance was in it."""


class RecordingLinkModel(LinkModel):
    """A link model that remembers what it drew last."""

    drawn: LinkDraw | None = None

    def fate(self, said_tick: int) -> Fate:
        """Draw, and remember it."""
        fate = super().fate(said_tick)
        self.drawn = LinkDraw(fate, bool(self.parameters.cut))
        return fate


class ReplayedTick(NamedTuple):
    """One tick as the replay lived through it."""

    record: TickRecord
    """What a recording of the replay would say."""
    incarnations: tuple[int, ...]
    """Who drove each joint when the tick was opened; 0: nobody."""
    newcomers: frozenset[int]
    """Boards that had just been let in: what was said before was not said to them."""
    observations: dict[int, Observation]
    """What each board was told that answered."""
    links: dict[Link, bytes]
    """Link frames said."""
    drawn: dict[Link, LinkDraw]
    """What the link models made of the frames of the tick before that were there to be used."""


class Replay:
    """The twin of a robot whose run was recorded."""

    def __init__(self, scenario: Scenario) -> None:
        self.twin = Twin(scenario, empty=True)  # Who came, and when, is in the recording.
        self.witnesses: list[list[RecordingLinkModel]] = [[] for _ in self.twin.boards]
        self.everybody: list[Board] = []
        """All boards there have been, also those that are gone."""

    def play(self, recorded: TickRecord) -> ReplayedTick:
        """Play the next tick. Raises `UnplayableError`."""
        lockstep = self.twin.lockstep
        roster = lockstep.plant.roster
        if not self.everybody:
            self._name(recorded)
        for event in recorded.events:
            self._check(event)
            if isinstance(event, BetweenTicks):
                self._before(event)
        newcomers = frozenset(roster.newcomers)
        observations = dict(lockstep.open())
        incarnations = tuple(roster.incarnations)
        for event in recorded.events:
            if isinstance(event, Midway):
                self._midway(event, observations)
        told, links = {}, dict[Link, bytes]()
        with redirect_stdout(NOWHERE):
            for board, payload in observations.items():
                told[board] = self._live(board, payload, links)
        drawn = {
            (witness.sender, witness.receiver): witness.drawn
            for board in observations
            for witness in self.witnesses[board]
            if witness.drawn is not None
        }
        return ReplayedTick(lockstep.close(), incarnations, newcomers, told, links, drawn)

    def _live(self, board: int, payload: bytes, links: dict[Link, bytes]) -> Observation:
        """Let a board live through the tick; what it was told. Keep the link frames it says."""
        firmware = self.twin.boards[board]
        assert firmware is not None
        for witness in self.witnesses[board]:
            witness.drawn = None
        try:
            observation = firmware.read(payload)
        except ProtocolError as error:
            raise UnplayableError(f"board {board} cannot be told: {error}") from error
        actuation = self.twin.answer(firmware, observation)
        for receiver, frame in zip(firmware.config.neighbours, actuation.links, strict=True):
            self.twin.deliver(board, receiver, frame)
            links[board, receiver] = frame
        return observation

    def _name(self, recorded: TickRecord) -> None:
        """Call the run what it was called: a plant that is started again chooses another name."""
        for answer in filter(None, recorded.answers):
            self.twin.lockstep.plant.run_id = decode(TorqueFrame, answer).run_id

    def _check(self, event: Event) -> None:
        try:
            check_event(event, self.twin.scenario.joints)
        except EventError as error:
            raise UnplayableError(f"{event!r} cannot have happened: {error}") from error

    def _before(self, event: BetweenTicks) -> None:
        """Carry out what happened between two ticks."""
        if isinstance(event, Scheduled):
            self.twin.lockstep.plant.obey(event)  # Who is put in or taken away is recorded too.
            return
        match event:
            case Admission(board, incarnation):
                self._admit(board, incarnation)
            case Departure(board, why):
                self._lose(board, why)
            case _:
                assert_never(event)

    def _midway(self, event: Midway, observations: dict[int, bytes]) -> None:
        """Carry out what happened while the tick was open."""
        match event:
            case MidwayDeparture(board, why):
                if observations.pop(board, None) is None:
                    raise UnplayableError(f"{event!r} cannot have happened")
                self._lose(board, why)
            case Excuse(sender, receiver):
                if receiver not in observations:
                    raise UnplayableError(f"{event!r} cannot have happened")
                observations[receiver] = self.twin.lockstep.excuse(sender, receiver)
            case _:
                assert_never(event)

    def _admit(self, board: int, incarnation: int) -> None:
        config = board_config(self.twin.scenario, self.twin.scenario.joints[board])
        run_id = self.twin.lockstep.plant.run_id
        firmware = assemble(config, run_id=run_id, incarnation=incarnation)
        self.witnesses[board] = [
            RecordingLinkModel(
                seed=config.seed, sender=sender, receiver=board, standing=hearing.link.parameters
            )
            for sender, hearing in zip(config.neighbours, firmware.hearings, strict=True)
        ]
        for hearing, witness in zip(firmware.hearings, self.witnesses[board], strict=True):
            hearing.link = witness
        self.everybody.append(firmware)
        self.twin.admit(firmware)

    def _lose(self, board: int, why: Why) -> None:
        self.witnesses[board] = []
        self.twin.remove(board, why)
