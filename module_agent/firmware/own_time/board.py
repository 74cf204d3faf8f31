"""One joint board in realtime: the same firmware, ticking at its own rate, waiting for nobody.

    board.observe(payload)          whenever an observation arrives
    board.hear(link, payload)       whenever a frame of a neighbour does
    actuation = board.play(slot)    once a period, with what there is

Rule 1: inside, a tick is an own period (a slot), so delay line, integrator and extrapolation are in
        the board's own time. On the wire ticks are the plant's: slot * ticks per period.
Rule 2: slots only go on, but may leap. Between two observations the latest one holds.
Rule 3: commands are obeyed in the next slot, also those in observations that have been overtaken.
Rule 4: what a slot does follows from what was observed and heard before it, and from its number;
        not from any clock. `used` says what that was, and a replay needs no more (S24).

The lumped delay is from the sensor to the joint. One period of it goes by on the way, between the
sample's arrival and the torque's effect; the delay line has the rest, in whole periods, at least 1.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from module_agent.custom.sandbox import rule_of
from module_agent.firmware.board import Actuation, AnsweredError, Board
from module_agent.firmware.body_view import BodyView
from module_agent.firmware.config import BoardConfig, ElectionConfig
from module_agent.firmware.election import Election, Gossip
from module_agent.firmware.frame_writer import Doing, Speech
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.link_model import LinkModel
from module_agent.firmware.own_time.election import RealtimeElection
from module_agent.firmware.own_time.mailbox import Mailbox
from module_agent.firmware.own_time.sensing import RealtimeSensing
from module_agent.firmware.own_time.view import RealtimeView
from module_agent.firmware.sensing import Sensing
from protocol.robot.cadence import Cadence
from protocol.robot.hardware import STEADY
from protocol.robot.states import State
from protocol.wire.frames import NO_TICK, Neighbour, Observation, ProtocolError, Reason
from protocol.wire.trace import LastWord, Mark, Taken


class Used(NamedTuple):
    """What a slot was played with."""

    seen_tick: int
    taken: tuple[Taken, ...]
    marks: Mark


def own_time(config: BoardConfig, cadence: Cadence) -> BoardConfig:
    """The same board with all times in its own periods, but for those of the election."""
    period = cadence.ticks_per_period[config.index]
    return replace(
        config,
        tick_s=config.tick_s * period,
        lumped_delay_ticks=max(1, config.lumped_delay_ticks // period - 1),
        clock=STEADY,  # Whoever drives the board has the clock, with all that is wrong with it.
    )


class RealtimeSpeech(Speech):
    """What a board says, with its own periods as ticks of the plant."""

    ticks_per_period = 1

    def to_neighbours(self, tick: int, gossip: Gossip, state: State) -> tuple[bytes, ...]:
        """As in lockstep."""
        return super().to_neighbours(tick * self.ticks_per_period, gossip, state)

    def to_plant(
        self,
        tick: int,
        gossip: Gossip,
        doing: Doing,
        *,
        counter: int,
        counted: int,
        said: Sequence[bytes],
    ) -> bytes:
        """As in lockstep."""
        tick *= self.ticks_per_period
        return super().to_plant(tick, gossip, doing, counter=counter, counted=counted, said=said)

    def of_fault(self, tick: int, code: int, told: str) -> tuple[bytes, ...]:
        """As in lockstep."""
        return super().of_fault(tick * self.ticks_per_period, code, told)

    def _for_below(self, state: State) -> tuple[int, tuple[float, ...]]:
        tick, seen = super()._for_below(state)
        return self._as_plant_tick(tick), seen

    def _for_above(self, state: State) -> tuple[int, tuple[float, ...]]:
        tick, seen = super()._for_above(state)
        return self._as_plant_tick(tick), seen

    def _as_plant_tick(self, tick: int) -> int:
        return tick if tick == NO_TICK else tick * self.ticks_per_period


class RealtimeBoard(Board):
    """The firmware of one joint board, from the observation in which the plant admits it."""

    def __init__(self, config: BoardConfig, *, run_id: int, incarnation: int) -> None:
        assert config.cadence is not None, "the scenario is one of realtime"
        self.cadence = config.cadence
        self.ticks_per_period = config.cadence.ticks_per_period[config.index]
        self._latest: Observation | None = None
        self._commands: list[bytes] = []
        self._mailboxes: list[Mailbox] = []
        self._there: tuple[int, ...] = ()
        """Incarnations of the neighbours in the last slot."""
        self.last_words: list[LastWord] = []
        """What was heard last of neighbours that are gone, for whoever drives this to tell."""
        self._rounds: RealtimeElection | None = None
        super().__init__(own_time(config, config.cadence), run_id=run_id, incarnation=incarnation)

    @property
    def seen_tick(self) -> int:
        """Tick of the latest observation; `NO_TICK` before the first."""
        return NO_TICK if self._latest is None else self._latest.tick

    def observe(self, payload: bytes) -> None:
        """Take an observation. Raises as `read` does."""
        self._latest = observation = self.read(payload)
        if observation.command:
            self._commands.append(observation.command)

    def play(self, slot: int) -> Actuation:
        """Live through one period of this board's; they come in order, but some may be left out."""
        assert self._latest is not None, "the loop begins with an observation"
        assert self.next_tick is None or slot >= self.next_tick
        for command in self._commands:
            self._obey(command)
        self._commands.clear()
        self._mourn(self._latest.neighbours)
        sampled_slot = self._latest.tick // self.ticks_per_period
        self._view.sampled_slot = self._sensing.sampled_slot = sampled_slot
        self._view.hold_until(slot - self.config.lumped_delay_ticks)
        return self.tick(self._latest._replace(tick=slot, command=b""))

    @property
    def used(self) -> Used:
        """What the last slot was played with."""
        taken = tuple(mailbox.taken for mailbox in self._mailboxes)
        marks = Mark(0) if self._rounds is None else self._rounds.marks
        return Used(self.seen_tick, taken, marks)

    def _mourn(self, roster: tuple[Neighbour, ...]) -> None:
        """Keep the last words of those that have left the roster."""
        there = tuple(neighbour.incarnation for neighbour in roster)
        if there == self._there:
            return
        for link, (before, now) in enumerate(zip(self._there, there, strict=False)):
            if before not in (0, now):
                sender, mailbox = self.config.neighbours[link], self._mailboxes[link]
                self.last_words += [
                    LastWord(self.run_id, self.incarnation, sender, frame) for frame in mailbox.kept
                ]
                mailbox.kept.clear()
        self._there = there

    def _expect(self, tick: int) -> None:
        if tick == self.seen_tick:
            raise AnsweredError
        if tick < self.seen_tick:
            raise ProtocolError(Reason.TICK, f"tick {tick} has been overtaken")

    def _make_hearing(self, link: LinkModel) -> Hearing:
        mailbox = Mailbox(
            link,
            run_id=self.run_id,
            boards=self.config.boards,
            ticks_per_period=self.ticks_per_period,
            sender_ticks_per_period=self.cadence.ticks_per_period[link.sender],
            ahead_ticks_max=self.cadence.ahead_ticks_max,
        )
        self._mailboxes.append(mailbox)
        return mailbox

    def _make_sensing(self) -> Sensing:
        config = self.config
        self._sensing = RealtimeSensing(
            config.sensor_sheet, tick_s=config.tick_s, has_imu=config.has_imu
        )
        return self._sensing

    def _make_view(self) -> BodyView:
        config = self.config
        above = self.cadence.ticks_per_period[config.index :]
        self._view = RealtimeView(
            config.link,
            tick_s=config.tick_s,
            lumped_delay_ticks=config.lumped_delay_ticks,
            has_imu=config.has_imu,
            bottom=config.index == 0,
            hold_ticks_max=self.cadence.age_ticks_max // self.ticks_per_period,
            pitch=-(-max(above) // self.ticks_per_period),
        )
        return self._view

    def _make_speech(self) -> Speech:
        speech = RealtimeSpeech(
            self.config,
            self.hearings,
            self.view,
            run_id=self.run_id,
            incarnation=self.incarnation,
        )
        speech.ticks_per_period = self.ticks_per_period
        return speech

    def _make_election(self, election: ElectionConfig) -> Election:
        self._rounds = RealtimeElection(
            election,
            rule_of(self.config),
            board=self.config.index,
            ticks_per_period=self.ticks_per_period,
            ticks_per_round=self.cadence.ticks_per_round,
        )
        return self._rounds
