"""One joint board: what its firmware does in one tick.

    actuation = board.tick(observation)      after board.hear(...) of what the network brought

A tick is: obey; sense; hear the neighbours; play a consensus round, and latch if it was the last
one; servo with the new enabling variable; say one link frame to each neighbour, and the torque to
the plant (S10). Everything a board does follows from the bytes it was given and their ticks.
"""

from collections import Counter
from math import fabs
from typing import NamedTuple

from module_agent.custom.sandbox import FaultError, controller_of, rule_of
from module_agent.firmware.body_view import BodySample, BodyView, Turn
from module_agent.firmware.config import BoardConfig, ElectionConfig
from module_agent.firmware.controller import Candidate, Seen
from module_agent.firmware.counts import COUNTS
from module_agent.firmware.election import Election, Gossip, Heard
from module_agent.firmware.frame_writer import Doing, Speech
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.lateness import speech
from module_agent.firmware.link_model import LinkModel
from module_agent.firmware.sensing import Sensing
from protocol.robot.commands import ANY, LINK, LinkParameters, decode_board_command
from protocol.robot.hardware import STEADY
from protocol.robot.scenario import Controls
from protocol.robot.states import Counters, State, entered
from protocol.wire.frames import NO_EPOCH, Observation, ProtocolError, Reason, decode

SYNCING, SAFE, FAULT = State.SYNCING, State.SAFE, State.FAULT


class Actuation(NamedTuple):
    """What a tick says: encoded frames, the links in the order of `BoardConfig.neighbours`."""

    torque: bytes
    links: tuple[bytes, ...]
    faults: tuple[bytes, ...] = ()
    """What has failed in this tick; to be said before the torque."""


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
        self.sensing: Sensing = self._make_sensing()
        self.view = self._make_view()
        self.speech = self._make_speech()
        self.servo = controller_of(config)
        elects = config.election
        self.election: Election | None = None if elects is None else self._make_election(elects)
        above, below = self.view.hear_from_above, self.view.hear_from_below
        self._hear_body = [above if other > config.index else below for other in config.neighbours]
        self.reference_rad = config.reference_rad
        self.state = State.ENROLLING
        self.fault: FaultError | None = None
        """What has put this board out of action."""
        self.held_rad: float | None = None
        self.next_tick: int | None = None
        self.refused: Counter[Reason] = Counter()
        self.state_ticks: list[int] = [0] * (max(State) + 1)
        self._synced_tick = 0
        self._unsaid: tuple[bytes, ...] = ()

    @property
    def enabled(self) -> bool:
        """The enabling variable y: whether this board moves to its reference, or holds."""
        if self.election is not None:
            return self.election.enabled
        return self.state is not SAFE and self.state is not FAULT

    @property
    def counters(self) -> Counters:
        """All that this board counts."""
        return Counters(*[count(self) for count in COUNTS])

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

    def hear(self, link: int, payload: bytes) -> int:
        """Take a frame of a link, whenever it came; the tick said, `NO_TICK` if it is of no use."""
        return self.hearings[link].put(payload)

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

        own = self.sensing.read(observation)
        self.view.forget(tick)
        if self.sensing.safe:
            self.view.sense(tick, own, top=self.config.top)
        gossip = self._hear(observation)

        body, state = self._body(tick)
        if state is not self.state:
            self.state = entered(self.state, state)
        torque_nm, controlled_rad = 0.0, 0.0
        if body is not None:
            controlled = self._controlled(body)
            controlled_rad = controlled.rad
            urgency = fabs(controlled_rad - self.reference_rad)
            self._elect(urgency, gossip, observation)
            if self.fault is None:
                torque_nm = self._drive(controlled, body, observation)
        elif state is not SYNCING:
            self._elect(0.0, gossip, observation)
        self.state_ticks[self.state] += 1
        return self._say(tick, torque_nm, controlled_rad)

    def _body(self, tick: int) -> tuple[BodySample | None, State]:
        """The sample to drive on in this tick, if there is one, and the state that this makes."""
        wanted_tick = tick - self.config.lumped_delay_ticks
        if self.fault is not None:
            return None, FAULT
        if tick < self._synced_tick:
            return None, SYNCING
        if not self.sensing.safe or not self.view.sampled(wanted_tick):
            return None, SAFE
        return self.view.at(wanted_tick)

    def _make_hearing(self, link: LinkModel) -> Hearing:
        return Hearing(link, run_id=self.run_id, boards=self.config.boards)

    def _make_sensing(self) -> Sensing:
        config = self.config
        uneven, imu = config.clock != STEADY, config.has_imu
        return Sensing(config.sensor_sheet, tick_s=config.tick_s, has_imu=imu, uneven=uneven)

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
        granted = {"run_id": self.run_id, "incarnation": self.incarnation}
        return speech(self.config, self.hearings, self.view, **granted)

    def _make_election(self, election: ElectionConfig) -> Election:
        return Election(election, rule_of(self.config), board=self.config.index)

    def _admitted(self, tick: int) -> None:
        self.state = entered(self.state, State.SYNCING)
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

    def _elect(self, urgency: float, heard: list[Heard], observation: Observation) -> None:
        election, tick = self.election, observation.tick
        if election is None:
            return
        if election.due(tick):
            roster = enumerate(observation.neighbours)
            linked = [link for link, other in roster if other.incarnation]
            try:
                election.tick(tick, urgency, heard, linked)
            except FaultError as fault:
                self._fail(tick, fault)
                election.tick(tick, 0.0, heard, linked)
        if self.state is SAFE or self.state is FAULT:
            election.enabled = False

    def _drive(self, controlled: Turn, body: BodySample, observation: Observation) -> float:
        enabled = self.enabled
        if enabled:
            target, goal_rad = controlled, self.reference_rad
            self.held_rad = None
        else:
            target = body.link if self.config.holds_orientation else controlled
            if self.held_rad is None:  # Disabled just now: stay where this sample is.
                self.held_rad = target.rad
            goal_rad = self.held_rad
        error_rad, rate_rad_s = target.rad - goal_rad, target.rad_s
        about = observation.tick, enabled, self.reference_rad, error_rad, rate_rad_s
        seen = Seen(*about, controlled, body, self.state, observation)
        try:
            return self.servo.torque_nm(seen)
        except FaultError as fault:
            self._fail(observation.tick, fault)
            return 0.0

    def _fail(self, tick: int, fault: FaultError) -> None:
        """Put this board out of action; what others say in an election it still passes on."""
        self.fault = fault
        self.state = entered(self.state, State.FAULT)
        self._unsaid = self.speech.of_fault(tick, fault.code, fault.told)
        if self.election is not None:
            self.election.relay(self.config)

    def _say(self, tick: int, torque_nm: float, controlled_rad: float) -> Actuation:
        gossip = self._gossip()
        said = self.speech.to_neighbours(tick, gossip, self.state)
        counter = tick % len(COUNTS)
        torque = self.speech.to_plant(
            tick,
            gossip,
            Doing(torque_nm, self.state, self.enabled, controlled_rad),
            counter=counter,
            counted=COUNTS[counter](self),
            said=said,
        )
        faults, self._unsaid = self._unsaid, ()
        return Actuation(torque, said, faults)

    def _gossip(self) -> Gossip:
        if self.election is None:
            return Gossip(NO_EPOCH, 0, Candidate(0.0, self.config.index))
        return self.election.gossip
