"""A run in realtime, played again: the same boards, on exactly what they used.

Rule 1: the plant is played from its record: what happened in each tick, and the torque frames that
        were in force. It must come to the same states, to the bit, and it makes the observations.
Rule 2: a board plays a period as soon as what it used is there: the observation, and the frames
        that its neighbours have said in *their* replay. Each torque frame that the plant had in
        force must come out again, and each link frame as its CRC says.
Rule 3: counts of refused frames are not compared: what was refused was not recorded, and changes
        nothing else.

A board that was killed takes the record of its last periods with it, a frame's worth. What it said
in them is taken from what its neighbours have told of it.
"""

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple, assert_never

from deploy.recording.replay import UnplayableError
from module_agent.assembly import assemble_on_own_time
from module_agent.firmware.board import Actuation
from module_agent.firmware.config import board_config
from plant_server.session.config import plant_config
from plant_server.session.free_running import FreeRunning
from plant_server.session.plant import Plant
from plant_server.session.record import TickRecord
from plant_server.spool.spool import PLANT, Spool
from protocol.robot.events import (
    Admission,
    BoardFault,
    Consequence,
    Departure,
    Event,
    Midway,
    Scheduled,
    check_event,
)
from protocol.robot.scenario import Scenario, run_id
from protocol.wire.frames import (
    NO_TICK,
    LinkFrame,
    Neighbour,
    Observation,
    ProtocolError,
    TorqueFrame,
    decode,
)
from protocol.wire.trace import TickTrace, Trace
from protocol.wire.trace_differences import decode_told
from protocol.wire.wiring import neighbours

IMPOSSIBLE = AssertionError, LookupError, ProtocolError, TypeError, ValueError
"""What playing comes to that cannot have been as it is recorded."""


class Life(NamedTuple):
    """One board from its admission on."""

    board: int
    incarnation: int


Said = dict[tuple[Life, int], Actuation]
"""What boards have said in their replay, by the tick in which they did."""
Words = dict[tuple[Life, int, int], bytes]
"""What boards that were killed have said last, by the tick, and who heard it."""


class RealtimeReplay(NamedTuple):
    """What came of a replay."""

    ticks: int
    """Of the plant, warm-up included."""
    periods: int
    """Of all boards."""
    torques: int
    """Torque frames that were compared."""
    unplayed: int
    """Periods that could not be played, because what was heard in them is not recorded."""
    differences: tuple[str, ...]
    """What did not come out as it was recorded, the first of each kind."""


def replay(spool: Spool, on_tick: Callable[[int], None] = lambda _tick: None) -> RealtimeReplay:
    """Play a recorded run again and compare; `on_tick` is told how far it is, in ticks.

    Raises ValueError for a run in lockstep, or `UnplayableError`.
    """
    if not spool.in_realtime:
        raise ValueError("this run is one in lockstep")
    plant = PlantReplay(spool)
    lives: dict[Life, deque[TickTrace]] = {}
    words: Words = {}
    said: Said = {}
    try:
        for record in spool.ticks:
            plant.play(record)
            on_tick(record.tick // 2)  # Boards are the other half of the work.
        for board, payload in spool.realtime:
            told = None if board == PLANT else decode_told(payload)
            if isinstance(told, Trace):
                lives.setdefault(Life(board, told.incarnation), deque()).extend(told.lived)
            elif told is not None:
                frame = decode(LinkFrame, told.frame)
                words[Life(told.sender, frame.incarnation), frame.tick, board] = told.frame
        boards = [
            _BoardReplay(spool.scenario, plant, life, lived, words) for life, lived in lives.items()
        ]
        half = spool.ticks[-1].tick // 2
        while sum(one.play(said) for one in boards):  # What one has said another may wait for.
            on_tick(half + half * sum(one.played for one in boards) // sum(map(len, boards)))
        torques, differences = _compare(plant, said)
    except IMPOSSIBLE as error:
        raise UnplayableError(f"a turn cannot have been as it is recorded: {error}") from error
    return RealtimeReplay(
        ticks=len(spool.ticks),
        periods=sum(one.played for one in boards),
        torques=torques,
        unplayed=sum(len(one.lived) for one in boards),
        differences=(*plant.differences, *differences),
    )


class PlantReplay:
    """The plant, played from its record."""

    def __init__(self, spool: Spool) -> None:
        self.run_id = _run_id(spool) or run_id(spool.scenario.digest)
        self.running = FreeRunning(Plant(plant_config(spool.scenario), run_id=self.run_id))
        self.observations: dict[Life, dict[int, bytes]] = {}
        """What each board was told, by tick."""
        self.in_force: dict[Life, dict[int, bytes]] = {}
        """Torque frames that were in force, by the tick in which they were said."""
        self.differences: list[str] = []

    def play(self, record: TickRecord) -> dict[int, bytes]:
        """Play one tick, and see whether it comes out as recorded; give the observations.

        Raises one of `IMPOSSIBLE`.
        """
        running, plant = self.running, self.running.plant
        for event in record.events:
            self._happen(event)
        observations = dict(running.open())
        for board, payload in observations.items():
            life = Life(board, plant.roster.incarnations[board])
            self.observations.setdefault(life, {})[record.tick] = payload
        for board, payload in enumerate(record.answers):
            if payload:
                frame = decode(TorqueFrame, payload)
                life = Life(board, frame.incarnation)
                self.in_force.setdefault(life, {})[frame.tick] = payload
                running.answer(board, payload)
        played = running.close()
        # Boards tell of faults; the plant is not asked to make them again.
        events = (event for event in record.events if not isinstance(event, BoardFault))
        told = record._replace(events=tuple(events))
        for what in ("angles_rad", "rates_rad_s", "torques_nm", "events"):
            now, then = getattr(played, what), getattr(told, what)
            if now != then and not self.differences:
                self.differences.append(f"tick {record.tick}: {what} {now}, recorded {then}")
        return observations

    def _happen(self, event: Event) -> None:
        plant = self.running.plant
        check_event(event, list(plant.config.joints))
        if isinstance(event, Scheduled):
            plant.obey(event)
        elif isinstance(event, Admission):
            plant.admit(event.board, event.incarnation)
        elif isinstance(event, Departure):
            self.running.remove(event.board, event.why)
        elif isinstance(event, Midway | Consequence):
            pass  # Nobody is waited for, so that nothing comes midway; the rest comes by itself.
        else:
            assert_never(event)

    def forget(self) -> None:
        """Let go of what boards were told, and said, so far."""
        self.observations.clear()
        self.in_force.clear()


class _BoardReplay:
    """One board, played from its traces."""

    def __init__(
        self,
        scenario: Scenario,
        plant: PlantReplay,
        life: Life,
        lived: deque[TickTrace],
        words: Words,
    ) -> None:
        config = board_config(scenario, scenario.boards[life.board].joint)
        self.life = life
        self.lived = lived
        self.played = 0
        self.neighbours = config.neighbours
        self.board = assemble_on_own_time(config, run_id=plant.run_id, incarnation=life.incarnation)
        self._told = deque(sorted(plant.observations.get(life, {}).items()))
        self._roster: tuple[Neighbour, ...] = ()
        self._taken = [NO_TICK] * len(config.neighbours)
        self._words = words

    def __len__(self) -> int:
        """How many turns it is to play, and has played."""
        return self.played + len(self.lived)

    def play(self, said: Said) -> bool:
        """Play as far as what was used is there; tell whether that was any way."""
        before = self.played
        while self.lived and self._play(self.lived[0], said):
            self.lived.popleft()
            self.played += 1
        return self.played > before

    def _play(self, lived: TickTrace, said: Said) -> bool:
        while self._told and self._told[0][0] <= lived.seen_tick:
            _, payload = self._told.popleft()
            self.board.observe(payload)
            self._roster = decode(Observation, payload).neighbours
        heard = [(link, self._frame(*key, said)) for link, key in self._heard(lived)]
        if self.board.seen_tick != lived.seen_tick or any(frame is None for _, frame in heard):
            return False
        for link, frame in heard:
            assert frame is not None
            self.board.hear(link, frame)
        said[self.life, self.board.own_time.plant_tick(lived.slot)] = self.board.play(lived.slot)
        self._taken = [taken.newest_tick for taken in lived.taken]
        return True

    def _frame(self, sender: Life, tick: int, said: Said) -> bytes | None:
        """What a neighbour has said to this board in a tick, if that is known."""
        actuation = said.get((sender, tick))
        if actuation is None:
            return self._words.get((sender, tick, self.life.board))
        back = neighbours(sender.board, self.board.board.config.boards)
        return actuation.links[back.index(self.life.board)]

    def _heard(self, lived: TickTrace) -> Iterator[tuple[int, tuple[Life, int]]]:
        """Which frames of which neighbours are new in a period: the link, who, and said when."""
        for link, (newest_tick, before) in enumerate(lived.taken):
            if newest_tick in (self._taken[link], NO_TICK):
                continue
            sender = Life(self.neighbours[link], self._roster[link].incarnation)
            period = self.board.own_time.cadence.ticks_per_period[sender.board]
            for age in range(before.bit_length(), 0, -1):
                if before >> (age - 1) & 1:
                    yield link, (sender, newest_tick - age * period)
            yield link, (sender, newest_tick)


def _run_id(spool: Spool) -> int | None:
    """What the run was called: a plant that is started again chooses another name."""
    for record in spool.ticks:
        for answer in filter(None, record.answers):
            return decode(TorqueFrame, answer).run_id
    return None


def _compare(plant: PlantReplay, said: Said) -> tuple[int, list[str]]:
    """Compare torque frames, and with them what they say of the link frames, but for counters."""
    compared, differences = 0, []
    for life, frames in plant.in_force.items():
        different = []
        for tick, payload in frames.items():
            actuation = said.get((life, tick))
            if actuation is not None:
                compared += 1
                if _uncounted(payload) != _uncounted(actuation.torque):
                    different.append(tick)
        if different:
            differences.append(
                f"board {life.board}, incarnation {life.incarnation}: {len(different)} torque"
                f" frames differ, first that of tick {different[0]}"
            )
    return compared, differences


def _uncounted(payload: bytes) -> TorqueFrame:
    return decode(TorqueFrame, payload)._replace(counter=0, counted=0)
