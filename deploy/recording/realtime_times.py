"""How boards in realtime kept their time: turn by turn, as arrays.

Rule 1: everything comes from what was recorded: the traces of the boards, the ticks of the plant.
Rule 2: ages are in the plant's time, as each board knew it. So no clocks need to be shared, and a
        figure is as good as the boards' estimates: about the time that a frame takes.
Rule 3: only what was after the release counts.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deploy.recording.epochs import epochs_played
from deploy.recording.trajectory import Floats, Integers
from plant_server.spool.spool import PLANT, Spool
from protocol.robot.cadence import cadence_of
from protocol.robot.events import Admission, Departure, Event, FreshTorque, StaleTorque
from protocol.robot.scenario import Scenario
from protocol.wire.frames import NO_TICK, TorqueFrame, decode
from protocol.wire.trace import Mark, TickTrace, Trace
from protocol.wire.trace_differences import decode_told
from protocol.wire.wiring import neighbours

US_PER_MS = 1e3
"""Events after which a board's torque is too old to be applied, or no longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTimeBoardTimes:
    """One board: its K turns, the T ticks of the plant, and E epochs."""

    rate_hz: float
    due_s: Floats
    """When the period began that each turn is for, in the body's time, (K,)."""
    late: NDArray[np.bool_]
    """Whether the torque came after the period's end, (K,)."""
    skipped: Integers
    """Periods left out before each turn, (K,)."""
    period_ms: Floats
    """From one turn to the next of the same incarnation; turns that made up for missed ones begin
    at once, and are not in it."""
    wake_late_ms: Floats
    """From when the turn was due, or the first period skipped for it, (K,)."""
    busy_ms: Floats
    """From then until the torque was on the way, interruptions included, (K,)."""
    observation_age_ms: Floats
    """Age of the observation that was used, (K,)."""
    neighbour_age_ms: dict[int, Floats]
    """Of each neighbour, while it was there as far as the board knew: how long ago its newest frame
    had been said."""
    torque_age_ms: Floats
    """How long ago the torque in force had been said, in each tick that has one."""
    torque_stale_ticks: int
    """Ticks in which it was too old to be applied."""
    decision_ms: Floats
    """From the beginning of each epoch to the decision, by the board's own reckoning; NaN: the
    board did not get to decide, (E,)."""

    @property
    def periods(self) -> int:
        """How many there were."""
        return len(self.late) + int(self.skipped.sum())

    @property
    def missed(self) -> int:
        """Periods whose torque was late, or never came."""
        return int(self.late.sum() + self.skipped.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class RealtimeTimes:
    """A run."""

    boards: list[OwnTimeBoardTimes]
    policy: str
    """What boards do about a missed deadline."""
    round_ms: float
    """How long a round of an election takes."""
    epochs: int | None
    """How many there was time for; None: nobody is elected."""
    behind_ms_max: float | None
    """How late the plant was for a tick, at worst; None: it did not get to say so."""
    slipped_s: float | None
    """Wall time that it gave up because it was too late."""


class RunClock:
    """Turns ticks into milliseconds, for one board."""

    def __init__(self, tick_ms: float, ticks_per_period: int) -> None:
        self.tick_ms = tick_ms
        self.ticks_per_period = ticks_per_period

    def tick(self, lived: TickTrace) -> int:
        """The first tick of the period that a turn is for."""
        return lived.slot * self.ticks_per_period

    def woke_ms(self, lived: TickTrace) -> float:
        """When a turn began, since the release."""
        return self.tick(lived) * self.tick_ms + lived.phase_us / US_PER_MS

    def said_ms(self, lived: TickTrace) -> float:
        """When its torque was on the way."""
        return self.woke_ms(lived) + lived.busy_us / US_PER_MS


Lives = list[list[TickTrace]]
"""What a joint's boards lived through: in order, a list for each incarnation."""


class RealtimeRecord(NamedTuple):
    """What times are found from: of a run with N boards, which was free for T ticks."""

    lives: list[Lives]
    """From the ground up."""
    said_tick: Integers
    """When the torque in force in each tick was said; `NO_TICK`: there was none, (T, N)."""
    events: Sequence[tuple[int, Event]]
    """What happened to the robot, with its tick."""
    account: dict[str, float]
    """What the plant told of its own pace, as the fields below; empty: it did not get to."""


def turns(spool: Spool) -> list[Lives]:
    """What each board lived through, from the ground up."""
    found: list[dict[int, list[TickTrace]]] = [{} for _ in spool.scenario.boards]
    for board, payload in spool.realtime:
        told = None if board == PLANT else decode_told(payload)
        if isinstance(told, Trace):
            found[board].setdefault(told.incarnation, []).extend(told.lived)
    return [list(lives.values()) for lives in found]


def _record(spool: Spool) -> RealtimeRecord:
    """What a spool has of a run in realtime."""
    free = [record for record in spool.ticks if record.tick >= 0]
    said_tick = [
        [decode(TorqueFrame, answer).tick if answer else NO_TICK for answer in record.answers]
        for record in free
    ]
    events = [(record.tick, event) for record in spool.ticks for event in record.events]
    accounts: list[dict[str, float]] = [told for board, told in spool.realtime if board == PLANT]
    boards = len(spool.scenario.boards)
    return RealtimeRecord(
        turns(spool),
        np.array(said_tick, np.int64).reshape(-1, boards),
        events,
        accounts[-1] if accounts else {},
    )


def realtime_times(spool: Spool) -> RealtimeTimes | None:
    """Find out from a spool; None of a run in lockstep."""
    if not spool.in_realtime:
        return None
    return times_of(spool.scenario, _record(spool))


def times_of(scenario: Scenario, record: RealtimeRecord) -> RealtimeTimes:
    """Find out how boards kept their time in a run of this scenario, which is one in realtime."""
    cadence = cadence_of(scenario)
    assert cadence is not None
    lives = [
        [[turn for turn in life if turn.slot >= 0] for life in of_board]
        for of_board in record.lives
    ]
    lived = [[turn for life in of_board for turn in life] for of_board in lives]
    tick_ms = scenario.run.tick_s * 1e3
    clocks = [RunClock(tick_ms, ticks) for ticks in cadence.ticks_per_period]
    said_ms = [
        {turn.slot * clock.ticks_per_period: clock.said_ms(turn) for turn in own}
        for clock, own in zip(clocks, lived, strict=True)
    ]
    epochs = epochs_played(scenario, len(record.said_tick))
    there = [_presence(record.events, board) for board in range(len(lived))]
    return RealtimeTimes(
        boards=[
            OwnTimeBoardTimes(
                **_loop(lived[board], clocks[board]),
                period_ms=_periods_ms(lives[board]),
                neighbour_age_ms={
                    other: _neighbour_ages_ms(
                        [turn for turn in lived[board] if there[other](turn.seen_tick)],
                        link,
                        clocks[board],
                        said_ms[other],
                    )
                    for link, other in enumerate(neighbours(board, len(lived)))
                },
                torque_age_ms=_torque_ages_ms(record.said_tick[:, board], said_ms[board], tick_ms),
                torque_stale_ticks=_stale_ticks(record, board),
                decision_ms=_decisions_ms(lived[board], clocks[board], scenario, epochs),
            )
            for board in range(len(lived))
        ],
        policy="catch-up" if cadence.catches_up else "skip",
        round_ms=cadence.ticks_per_round * tick_ms,
        epochs=epochs,
        behind_ms_max=record.account.get("behind_ms_max"),
        slipped_s=record.account.get("slipped_s"),
    )


def _loop(lived: Sequence[TickTrace], clock: RunClock) -> dict[str, Any]:
    """What follows from a board's own turns."""
    period_ms = clock.ticks_per_period * clock.tick_ms
    return {
        "rate_hz": 1e3 / period_ms,
        "due_s": np.array([turn.slot * period_ms / 1e3 for turn in lived], np.float64),
        "late": np.array([bool(turn.marks & Mark.LATE) for turn in lived], np.bool_),
        "skipped": np.array([turn.skipped for turn in lived], np.int64),
        "wake_late_ms": np.array([turn.late_us for turn in lived], np.float64) / US_PER_MS,
        "busy_ms": np.array([turn.busy_us for turn in lived], np.float64) / US_PER_MS,
        "observation_age_ms": _ages(
            clock.woke_ms(turn) - turn.seen_tick * clock.tick_ms for turn in lived
        ),
    }


def _periods_ms(lives: Sequence[Sequence[TickTrace]]) -> Floats:
    """From one turn to the next of the same incarnation; turns made up for begin at once."""
    found = [np.diff(np.array([turn.woke_us for turn in life], np.float64)) for life in lives]
    between_us: Floats = np.concatenate([*found, np.empty(0)])
    return between_us[between_us > 0.0] / US_PER_MS


def _decisions_ms(
    lived: Sequence[TickTrace], clock: RunClock, scenario: Scenario, epochs: int | None
) -> Floats:
    found: Floats = np.full(epochs or 0, np.nan)
    period_ticks = scenario.election.period_ticks
    for turn in lived:
        epoch = turn.slot * clock.ticks_per_period // period_ticks
        if turn.marks & Mark.LATCHED and epoch < len(found):
            found[epoch] = clock.said_ms(turn) - epoch * period_ticks * clock.tick_ms
    return found


def _torque_ages_ms(said_ticks: Integers, said_ms: dict[int, float], tick_ms: float) -> Floats:
    """Age of the torque in force at the beginning of each tick."""
    return _ages(
        tick * tick_ms - said_ms.get(said_tick, said_tick * tick_ms)
        for tick, said_tick in enumerate(said_ticks.tolist())
        if said_tick != NO_TICK
    )


def _stale_ticks(record: RealtimeRecord, board: int) -> int:
    """Ticks in which the torque of a board was too old to be applied."""
    ticks, since = 0, None
    for tick, event in record.events:
        if tick < 0 or not isinstance(event, StaleTorque | FreshTorque | Departure):
            continue
        if event.board != board:
            continue
        if since is not None:
            ticks += tick - since
        since = tick if isinstance(event, StaleTorque) else None
    return ticks if since is None else ticks + len(record.said_tick) - since


def _presence(events: Sequence[tuple[int, Event]], board: int) -> Callable[[int], bool]:
    """Tells of a tick whether a board was on the roster."""
    changes = [
        (tick, isinstance(event, Admission))
        for tick, event in events
        if isinstance(event, Admission | Departure) and event.board == board
    ]

    def present(tick: int) -> bool:
        before = bisect_right(changes, tick, key=lambda change: change[0])
        return before > 0 and changes[before - 1][1]

    return present


def _neighbour_ages_ms(
    lived: Sequence[TickTrace], link: int, clock: RunClock, said_ms: dict[int, float]
) -> Floats:
    """Time since the newest frame of a neighbour had been said, whenever a turn began."""

    def ages() -> Iterator[float]:
        for turn in lived:
            said_tick = turn.taken[link].newest_tick
            if said_tick != NO_TICK:
                said = said_ms.get(said_tick, said_tick * clock.tick_ms)
                yield clock.woke_ms(turn) - said

    return _ages(ages())


def _ages(values: Iterator[float]) -> Floats:
    """Ages by two estimates of one clock can come out below 0, by next to nothing."""
    found: Floats = np.maximum(np.fromiter(values, np.float64), 0.0)
    return found
