"""One joint board: what its firmware does in one tick.

    actuation = board.tick(observation)      after board.hear(...) of what the network brought

A tick is: obey; sense; hear the neighbours; play a consensus round, and latch if it was the last
one; servo with the new enabling variable; say one link frame to each neighbour, and the torque to
the plant (S10). Everything a board does follows from the bytes it was given and their ticks.
"""

from collections import Counter
from collections.abc import Callable
from math import fabs
from typing import NamedTuple

from module_agent.body_view import BodySample, BodyView, Turn
from module_agent.config import BoardConfig, Controls
from module_agent.consensus import Candidate, Gossip
from module_agent.election import Election, ElectionConfig, Heard
from module_agent.hearing import Hearing
from module_agent.link_model import LinkModel
from module_agent.sensing import Sensing
from module_agent.servo import Servo
from module_agent.speech import Doing, Speech
from protocol.commands import ANY, LINK, LinkParameters, decode_board_command
from protocol.frames import NO_EPOCH, Observation, ProtocolError, Reason, decode
from protocol.states import COUNTERS, State


class Actuation(NamedTuple):
    """What a tick says: encoded frames, the links in the order of `BoardConfig.neighbours`."""

    torque: bytes
    links: tuple[bytes, ...]


class AnsweredError(Exception):
    """An observation of the tick that was answered last: the plant has not got the answer."""


class ReplacedError(Exception):
    """The plant addresses another incarnation of this joint, or none (0)."""

    def __init__(self, incarnation: int) -> None:
        super().__init__(f"the plant addresses incarnation {incarnation}")
        self.incarnation = incarnation


class Board:
    """The firmware of one joint board, from the tick in which the plant admits it."""

    def __init__(self, config: BoardConfig, *, run_id: int, incarnation: int) -> None:
        self.config = config
        self.run_id = run_id
        self.incarnation = incarnation
        self.hearings = [
            self._make_hearing(
                LinkModel(seed=config.seed, sender=sender, receiver=config.index, standing=standing)
            )
            for sender, standing in zip(config.neighbours, config.standing_links, strict=True)
        ]
        self.sensing = Sensing()
        self.view = self._make_view()
        self.speech = self._make_speech()
        self.servo = Servo(config.gains, tick_s=config.tick_s)
        self.election = None if config.election is None else self._make_election(config.election)
        self._hear_body = [
            self.view.hear_from_above if other > config.index else self.view.hear_from_below
            for other in config.neighbours
        ]
        self.reference_rad = config.reference_rad
        self.state = State.SYNCING
        self.held_rad: float | None = None
        self.next_tick: int | None = None
        self.refused: Counter[Reason] = Counter()
        self.state_ticks: Counter[State] = Counter()
        self._synced_tick = 0

    @property
    def enabled(self) -> bool:
        """The enabling variable y: whether this board moves to its reference, or holds."""
        return self.state is not State.SAFE and (self.election is None or self.election.enabled)

    def read(self, payload: bytes) -> Observation:
        """Check an observation.

        Raises `ProtocolError`, `ReplacedError` when it is not for this incarnation, or
        `AnsweredError` when it is of the tick that was lived through last.
        """
        observation = decode(Observation, payload)
        if observation.run_id != self.run_id:
            raise ProtocolError(Reason.RUN, f"run {observation.run_id:08x}")
        if observation.incarnation != self.incarnation:
            raise ReplacedError(observation.incarnation)
        self._expect(observation.tick)
        if len(observation.neighbours) != len(self.hearings):
            raise ProtocolError(Reason.RANGE, f"a roster of {len(observation.neighbours)}")
        return observation

    def _expect(self, tick: int) -> None:
        if self.next_tick is not None and tick != self.next_tick:
            if tick == self.next_tick - 1:
                raise AnsweredError
            raise ProtocolError(Reason.TICK, f"tick {tick}, expected {self.next_tick}")

    def hear(self, link: int, payload: bytes) -> None:
        """Take a frame that arrived on the `link`-th of this board's links, whenever it did."""
        self.hearings[link].put(payload)

    def missing(self, observation: Observation) -> int | None:
        """The first link whose frame of the tick before has yet to arrive, if any."""
        said_tick = observation.tick - 1
        for link, neighbour in enumerate(observation.neighbours):
            there = neighbour.incarnation != 0 and neighbour.waits
            due = there and neighbour.completed_tick == said_tick
            if due and not self.hearings[link].has(said_tick, neighbour):
                return link
        return None

    def tick(self, observation: Observation) -> Actuation:
        """Live through one tick. Ticks come one after the other, without gaps."""
        tick = observation.tick
        if self.next_tick is None:
            self._admitted(tick)
        self.next_tick = tick + 1
        if observation.command:
            self._obey(observation.command)

        joint, imu = self.sensing.read(observation)
        self.view.forget(tick)
        if self.sensing.safe:
            self.view.sense(tick, joint, imu, top=self.config.top)
        gossip = self._hear(observation)

        torque_nm, controlled_rad = 0.0, 0.0
        wanted_tick = tick - self.config.lumped_delay_ticks
        if tick < self._synced_tick:
            self.state = State.SYNCING
        elif not self.sensing.safe or not self.view.sampled(wanted_tick):
            self.state = State.SAFE
            self._elect(tick, 0.0, gossip, observation)
        else:
            body, self.state = self.view.at(wanted_tick)
            controlled = self._controlled(body)
            controlled_rad = controlled.rad
            urgency = fabs(controlled_rad - self.reference_rad)
            self._elect(tick, urgency, gossip, observation)
            torque_nm = self._drive(controlled, body)
        self.state_ticks[self.state] += 1
        return self._say(tick, torque_nm, controlled_rad)

    def _make_hearing(self, link: LinkModel) -> Hearing:
        return Hearing(link, run_id=self.run_id, boards=self.config.boards)

    def _make_view(self) -> BodyView:
        config = self.config
        return BodyView(
            config.link,
            tick_s=config.tick_s,
            lumped_delay_ticks=config.lumped_delay_ticks,
            has_imu=config.has_imu,
            bottom=config.index == 0,
        )

    def _make_speech(self) -> Speech:
        return Speech(
            self.config,
            self.hearings,
            self.view,
            run_id=self.run_id,
            incarnation=self.incarnation,
        )

    def _make_election(self, election: ElectionConfig) -> Election:
        return Election(election, board=self.config.index)

    def _admitted(self, tick: int) -> None:
        self._synced_tick = max(0, tick + self.config.lumped_delay_ticks)
        if self._synced_tick > 0 and self.election is not None:
            self.election.enabled = False  # Until an election says otherwise (S11).

    def _obey(self, payload: bytes) -> None:
        command = decode_board_command(payload)
        if command is None:
            self.refused[Reason.MALFORMED] += 1
        elif command.kind == LINK:
            for sender, hearing in zip(self.config.neighbours, self.hearings, strict=True):
                if command.sender in (sender, ANY):
                    hearing.link.change(LinkParameters(*command.values))
        else:
            (self.reference_rad,) = command.values

    def _hear(self, observation: Observation) -> list[Heard]:
        """Use what arrives in this tick: bodies for the view, gossip for the election."""
        tick, heard = observation.tick, []
        elects = self.election is not None and self.election.due(tick)
        for link, neighbour in enumerate(observation.neighbours):
            for frame in self.hearings[link].take(tick, neighbour):
                self._hear_body[link](frame)
                if elects:
                    best = Candidate(frame.urgency, frame.candidate)
                    heard.append(Heard(link, Gossip(frame.epoch, frame.round, best)))
        return heard

    def _controlled(self, body: BodySample) -> Turn:
        match self.config.controls:
            case Controls.BODY_SWAY:
                return body.sway
            case Controls.JOINT_ANGLE:
                return body.joint
            case Controls.LINK_ORIENTATION:
                return body.link

    def _elect(
        self, tick: int, urgency: float, heard: list[Heard], observation: Observation
    ) -> None:
        election = self.election
        if election is None:
            return
        if election.due(tick):
            roster = enumerate(observation.neighbours)
            election.tick(
                tick, urgency, heard, [link for link, other in roster if other.incarnation]
            )
        if self.state is State.SAFE:
            election.enabled = False

    def _drive(self, controlled: Turn, body: BodySample) -> float:
        if self.enabled:
            target, goal_rad = controlled, self.reference_rad
            self.held_rad = None
        else:
            target = body.link if self.config.holds_orientation else controlled
            if self.held_rad is None:  # Disabled just now: stay where this sample is.
                self.held_rad = target.rad
            goal_rad = self.held_rad
        return self.servo.torque_nm(
            error_rad=target.rad - goal_rad,
            rate_rad_s=target.rad_s,
            com_sway_rad=body.supported.sway_rad(),
        )

    def _say(self, tick: int, torque_nm: float, controlled_rad: float) -> Actuation:
        gossip = self._gossip()
        said = self.speech.to_neighbours(tick, gossip, self.state)
        counter = tick % len(COUNTERS)
        torque = self.speech.to_plant(
            tick,
            gossip,
            Doing(torque_nm, self.state, self.enabled, controlled_rad),
            counter=counter,
            counted=self._count(counter),
            said=said,
        )
        return Actuation(torque, said)

    def _gossip(self) -> Gossip:
        if self.election is None:
            return Gossip(NO_EPOCH, 0, Candidate(0.0, self.config.index))
        return self.election.consensus.gossip

    def _count(self, counter: int) -> int:
        """The value of one of `protocol.states.COUNTERS`."""
        if counter >= len(OWN_COUNTS):
            reason = REASONS[counter - len(OWN_COUNTS)]
            return self.refused[reason] + sum(hearing.refused[reason] for hearing in self.hearings)
        return OWN_COUNTS[counter](self)


REASONS = tuple(Reason)
OWN_COUNTS: tuple[Callable[[Board], int], ...] = (
    lambda board: board.state_ticks[State.HOLDING],
    lambda board: board.state_ticks[State.EXTRAPOLATING],
    lambda board: board.state_ticks[State.RECKONING],
    lambda board: board.sensing.implausible_samples,
    lambda board: 0 if board.election is None else board.election.incomplete_epochs,
)
"""What a board counts but for refusals, in the order of `protocol.states.COUNTERS`."""
