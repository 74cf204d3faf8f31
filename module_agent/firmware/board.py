"""One joint board: what its firmware does in one tick.

    actuation = board.tick(observation)      after board.hear(...) of what the network brought

One tick (S10): obey the command that came; read the own sensors; hear what the neighbours said a
tick ago; play a consensus round and, if it was the last one, latch y; servo with that y on the
sample of one lumped delay ago; say a link frame to each neighbour, and the torque to the plant.

Everything a board does follows from the bytes it was given and their ticks. Its parts are given to
it (`module_agent.assembly`); the clock of its ticks may be the plant's or its own (`own_time`).
"""

from collections import Counter
from collections.abc import Callable
from math import fabs
from typing import NamedTuple, assert_never

from module_agent.firmware.body_view import AngleAndRate, BodySample, BodyView
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.controller import Candidate, Controller, FaultError, ServoInput
from module_agent.firmware.election import Election, Gossip, HeardGossip
from module_agent.firmware.frame_writer import FrameWriter, Statement
from module_agent.firmware.hearing import LinkEnd
from module_agent.firmware.lateness import Lateness
from module_agent.firmware.sensing import Sensing
from protocol.robot.events import ANY, LinkOrder, ReferenceOrder, decode_board_command
from protocol.robot.scenario import Controls
from protocol.robot.states import COUNTERS, Counters, State, entered
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


class Parts(NamedTuple):
    """What a board is assembled from."""

    hearings: list[LinkEnd]
    """Its ends of the links from its neighbours, in the order of `BoardConfig.neighbours`."""
    sensing: Sensing
    view: BodyView
    writer: FrameWriter
    servo: Controller
    election: Election | None
    """None: it stays enabled (the original DEC)."""
    lateness: Lateness | None
    """None: its loop always ends in time."""


class Board:
    """The firmware of one joint board, from the tick in which the plant admits it."""

    def __init__(self, config: BoardConfig, parts: Parts, *, run_id: int, incarnation: int) -> None:
        self.config = config
        self.run_id = run_id
        self.incarnation = incarnation
        self.hearings = parts.hearings
        self.sensing = parts.sensing
        self.view = parts.view
        self.writer = parts.writer
        self.servo = parts.servo
        self.election = parts.election
        self.lateness = parts.lateness
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
        self._fault_frames: tuple[bytes, ...] = ()

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
        """Check the observation of the next tick.

        Raises `ProtocolError`, `ReplacedError` when it is not for this incarnation, or
        `AnsweredError` when it is of the last tick.
        """
        observation = self.read_any(payload)
        tick = observation.tick
        if self.next_tick is not None and tick != self.next_tick:
            if tick == self.next_tick - 1:
                raise AnsweredError
            raise ProtocolError(Reason.TICK, f"tick {tick}, expected {self.next_tick}")
        if len(observation.neighbours) != len(self.hearings):
            self.check_roster(observation)
        return observation

    def read_any(self, payload: bytes) -> Observation:
        """Check an observation of whichever tick. Raises `ProtocolError` or `ReplacedError`."""
        observation = decode(Observation, payload)
        if observation.run_id != self.run_id:
            raise ProtocolError(Reason.RUN, f"run {observation.run_id:08x}")
        if observation.incarnation != self.incarnation:
            raise ReplacedError(observation.incarnation)
        return observation

    def check_roster(self, observation: Observation) -> None:
        """See whether a roster is of as many neighbours as there are. Raises `ProtocolError`."""
        if len(observation.neighbours) != len(self.hearings):
            raise ProtocolError(Reason.RANGE, f"a roster of {len(observation.neighbours)}")

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
        """Go through one tick of the plant's. They come one after the other, without gaps."""
        return self.step(observation.tick, observation.tick, observation)

    def step(self, tick: int, round_: int, observation: Observation) -> Actuation:
        """Go through one tick, which is in round `round_` of the elections.

        `observation` is the latest; its tick says when it was taken, also in own ticks.
        """
        if self.next_tick is None:
            self._admitted(tick)
        self.next_tick = tick + 1
        if observation.command:
            self.obey(observation.command)

        self.view.advance(tick)
        own = self.sensing.read(observation)
        if self.sensing.safe:
            self.view.sense(observation.tick, own, top=self.config.top)
        gossip = self._hear(tick, round_, observation)

        body, state = self._body(tick)
        if state is not self.state:
            self.state = entered(self.state, state)
        torque_nm, controlled_rad = 0.0, 0.0
        if body is not None:
            controlled = self._controlled(body)
            controlled_rad = controlled.rad
            urgency = fabs(controlled_rad - self.reference_rad)
            self._elect(tick, round_, urgency, gossip, observation)
            if self.fault is None:
                torque_nm = self._drive(tick, controlled, body, observation)
        elif state is not SYNCING:
            self._elect(tick, round_, 0.0, gossip, observation)
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

    def _admitted(self, tick: int) -> None:
        self.state = entered(self.state, State.SYNCING)
        self._synced_tick = max(0, tick + self.config.lumped_delay_ticks)
        if self._synced_tick > 0 and self.election is not None:
            self.election.enabled = False  # Until an election says otherwise (S11).

    def obey(self, payload: bytes) -> None:
        """Do what the plant has been told to have this board do."""
        command = decode_board_command(payload)
        match command:
            case None:
                self.refused[Reason.MALFORMED] += 1
            case LinkOrder():
                for sender, end in zip(self.config.neighbours, self.hearings, strict=True):
                    if command.sender in (sender, ANY):
                        end.link.change(command.parameters)
            case ReferenceOrder():
                self.reference_rad = command.reference_rad
            case _:
                assert_never(command)

    def _hear(self, tick: int, round_: int, observation: Observation) -> list[HeardGossip]:
        """Use what arrives in this tick: bodies for the view, gossip for the election."""
        heard = []
        elects = self.election is not None and self.election.due(round_)
        for link, neighbour in enumerate(observation.neighbours):
            for frame in self.hearings[link].take(tick, neighbour):
                self._hear_body[link](frame)
                if elects:
                    best = Candidate(frame.urgency, frame.candidate)
                    heard.append(HeardGossip(link, Gossip(frame.epoch, frame.round, best)))
        return heard

    def _controlled(self, body: BodySample) -> AngleAndRate:
        match self.config.controls:
            case Controls.BODY_SWAY:
                return body.sway
            case Controls.JOINT_ANGLE:
                return body.joint
            case Controls.LINK_ORIENTATION:
                return body.link

    def _elect(
        self,
        tick: int,
        round_: int,
        urgency: float,
        heard: list[HeardGossip],
        observation: Observation,
    ) -> None:
        election = self.election
        if election is None:
            return
        if election.due(round_):
            roster = enumerate(observation.neighbours)
            rostered = [link for link, other in roster if other.incarnation]
            try:
                election.tick(round_, urgency, heard, rostered)
            except FaultError as fault:
                self._fail(tick, fault)
                election.tick(round_, 0.0, heard, rostered)
        if self.state is SAFE or self.state is FAULT:
            election.enabled = False

    def _drive(
        self, tick: int, controlled: AngleAndRate, body: BodySample, observation: Observation
    ) -> float:
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
        about = tick, enabled, self.reference_rad, error_rad, rate_rad_s
        seen = ServoInput(*about, controlled, body, self.state, observation)
        try:
            return self.servo.torque_nm(seen)
        except FaultError as fault:
            self._fail(tick, fault)
            return 0.0

    def _fail(self, tick: int, fault: FaultError) -> None:
        """Put this board out of action; what others say in an election it still passes on."""
        self.fault = fault
        self.state = entered(self.state, State.FAULT)
        self._fault_frames = self.writer.of_fault(tick, fault.code, fault.summary)
        if self.election is not None:
            self.election.relay(self.config)

    def _say(self, tick: int, torque_nm: float, controlled_rad: float) -> Actuation:
        bodies, enabled = self.writer.bodies(self.state), self.enabled
        now = Statement(self._gossip(), bodies, torque_nm, self.state, enabled, controlled_rad)
        if self.lateness is not None:
            now = self.lateness.statement(tick, now)
        links = self.writer.to_neighbours(tick, now)
        counter = tick % len(COUNTS)
        counted = COUNTS[counter](self)
        torque = self.writer.to_plant(tick, now, counter=counter, counted=counted, payloads=links)
        faults, self._fault_frames = self._fault_frames, ()
        return Actuation(torque, links, faults)

    def _gossip(self) -> Gossip:
        if self.election is None:
            return Gossip(NO_EPOCH, 0, Candidate(0.0, self.config.index))
        return self.election.gossip


def _refused(reason: Reason) -> Callable[[Board], int]:
    return lambda board: board.refused[reason] + sum(end.refused[reason] for end in board.hearings)


COUNTS: tuple[Callable[[Board], int], ...] = (
    lambda board: board.state_ticks[State.HOLDING],
    lambda board: board.state_ticks[State.EXTRAPOLATING],
    lambda board: board.state_ticks[State.RECKONING],
    lambda board: board.sensing.implausible_samples,
    lambda board: 0 if board.election is None else board.election.incomplete_epochs,
    *map(_refused, Reason),
    lambda board: board.sensing.inconsistent_samples,
    lambda board: board.sensing.stuck_samples,
)
"""Where a board keeps each number that it tells of itself, in the order of `COUNTERS`."""
assert len(COUNTS) == len(COUNTERS)
