"""How a run in realtime kept its time: deadlines, ages of what was used, elections.

Rule 1: everything comes from what was recorded: the traces of the boards, the ticks of the plant.
Rule 2: ages are in the plant's time, as each board knew it. So no clocks need to be shared, and a
        figure is as good as the boards' estimates: about the time that a frame takes.
Rule 3: only what was after the release counts.

    boards.{joint}      rate_hz; periods, in_time, late, skipped, missed_share: what became of each
                        deadline; torque_stale_ticks; epochs_decided, epochs_missed;
                        period_ms, wake_late_ms, busy_ms, observation_age_ms, torque_age_ms,
                        decision_ms, and neighbour_age_ms by neighbour: p50, p99 and max
    missed, round_ms    policy for missed deadlines, and how long a round of an election takes
    behind_ms_max       how late the plant was for a tick, at worst
    slipped_s           wall time that it gave up because it was too late
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from deploy.indices import NEVER, Elections
from deploy.trajectory import Trajectory
from plant_server.record import TickRecord
from plant_server.spool import PLANT, Spool
from protocol.cadence import Cadence, cadence_of
from protocol.frames import NO_TICK, TorqueFrame, decode
from protocol.trace import Lived, Mark, Trace, decode_told
from protocol.wiring import neighbours

Spread = dict[str, float | None]


class Clock(NamedTuple):
    """What turns ticks into milliseconds, for one board."""

    tick_ms: float
    ticks_per_period: int

    def woke_ms(self, lived: Lived) -> float:
        """When a tick of the board began, since the release."""
        return lived.slot * self.ticks_per_period * self.tick_ms + lived.phase_us / 1e3

    def said_ms(self, lived: Lived) -> float:
        """When its torque was on the way."""
        return self.woke_ms(lived) + lived.busy_us / 1e3


def traces(spool: Spool) -> list[list[Lived]]:
    """What each board lived through, in order, from the ground up; all incarnations in one."""
    found: list[list[Lived]] = [[] for _ in spool.scenario["board"]]
    for board, payload in spool.realtime:
        told = None if board == PLANT else decode_told(payload)
        if isinstance(told, Trace):
            found[board] += told.lived
    return found


def realtime_summary(spool: Spool) -> dict[str, Any] | None:
    """Sum up how a run kept its time; None for one in lockstep."""
    cadence = cadence_of(spool.scenario)
    if cadence is None or spool.outcome is None:
        return None
    lived = [[tick for tick in ticks if tick.slot >= 0] for ticks in traces(spool)]
    tick_ms = spool.scenario["run"]["tick_s"] * 1e3
    clocks = [Clock(tick_ms, ticks) for ticks in cadence.ticks_per_period]
    said_ms = [
        {tick.slot * clock.ticks_per_period: clock.said_ms(tick) for tick in ticks}
        for clock, ticks in zip(clocks, lived, strict=True)
    ]
    joints = [board["joint"] for board in spool.scenario["board"]]
    epochs = _epochs(spool, cadence)
    free = [record for record in spool.ticks if record.tick >= 0]
    boards = {}
    for board, joint in enumerate(joints):
        boards[joint] = {
            **_deadlines(lived[board], clocks[board]),
            **_elections(lived[board], clocks[board], spool.scenario, epochs),
            "torque_age_ms": _spread(_torque_ages_ms(free, board, said_ms[board], tick_ms)),
            "torque_stale_ticks": _stale_ticks(free, board),
            "neighbour_age_ms": {
                joints[other]: _spread(
                    _neighbour_ages_ms(lived[board], link, clocks[board], said_ms[other])
                )
                for link, other in enumerate(neighbours(board, len(joints)))
            },
        }
    accounts: list[dict[str, float]] = [told for board, told in spool.realtime if board == PLANT]
    plant = accounts[-1] if accounts else {"behind_ms_max": None, "slipped_s": None}
    return {
        "missed": spool.scenario["realtime"]["missed"],
        "round_ms": cadence.ticks_per_round * tick_ms,
        **plant,
        "boards": boards,
    }


def realtime_elections(trajectory: Trajectory) -> Elections | None:
    """Count rounds to agreement and enabled boards per epoch, as `deploy.indices.elections` does.

    Without a barrier, boards are compared at the end of an epoch, when all have long decided. Only
    those that stood for it have a say.
    """
    election, cadence = trajectory.scenario["election"], cadence_of(trajectory.scenario)
    if not election["enabled"] or cadence is None:
        return None
    period, rounds = election["period_ticks"], election["rounds"]
    taken: Counter[int | str] = Counter()
    enabled: Counter[int] = Counter()
    for epoch in range(_whole_epochs(trajectory.ticks, period, rounds, cadence)):
        window = slice(epoch * period, min((epoch + 1) * period, trajectory.ticks))
        members = trajectory.epoch[window][-1] == epoch
        if members.any():
            taken[_agreement(trajectory, epoch, window, np.flatnonzero(members))] += 1
            enabled[int(trajectory.enabled[window][-1, members].sum())] += 1
    epochs = enabled.total()
    played = {str(n): taken[n] for n in range(rounds + 1) if taken[n]}
    return Elections(
        epochs=epochs,
        rounds_to_agreement={**played, NEVER: taken[NEVER]},
        enabled_0=enabled[0],
        enabled_1=enabled[1],
        enabled_2_or_more=epochs - enabled[0] - enabled[1],
    )


def _agreement(
    trajectory: Trajectory, epoch: int, window: slice, members: Iterable[int]
) -> int | str:
    """The round after which all members knew the largest urgency that any of them ever knew."""
    known: dict[int, dict[tuple[float, int], int]] = {}
    for board in members:
        firsts: dict[tuple[float, int], int] = {}
        for tick in range(window.start, window.stop):
            if trajectory.epoch[tick, board] == epoch:
                best = trajectory.urgency[tick, board], trajectory.candidate[tick, board]
                firsts.setdefault(best, int(trajectory.round[tick, board]))
        known[board] = firsts
    most = max(best for firsts in known.values() for best in firsts)
    if any(most not in firsts for firsts in known.values()):
        return NEVER
    return max(firsts[most] for firsts in known.values())


def _epochs(spool: Spool, cadence: Cadence) -> int | None:
    election = spool.scenario["election"]
    if not election["enabled"] or spool.outcome is None:
        return None
    return _whole_epochs(spool.outcome.tick, election["period_ticks"], election["rounds"], cadence)


def _whole_epochs(ticks: int, period_ticks: int, rounds: int, cadence: Cadence) -> int:
    """Epochs that had time for all their rounds, and one more to tell of it."""
    needed = (rounds + 1) * cadence.ticks_per_round
    return max(0, (ticks - needed) // period_ticks + 1)


def _deadlines(lived: Sequence[Lived], clock: Clock) -> dict[str, Any]:
    skipped = sum(tick.skipped for tick in lived)
    late = sum(bool(tick.marks & Mark.LATE) for tick in lived)
    periods = len(lived) + skipped
    turns = [now.woke_us - then.woke_us for then, now in pairwise(lived)]
    ages_ms = [clock.woke_ms(tick) - tick.seen_tick * clock.tick_ms for tick in lived]
    return {
        "rate_hz": 1e3 / (clock.ticks_per_period * clock.tick_ms),
        "periods": periods,
        "in_time": len(lived) - late,
        "late": late,
        "skipped": skipped,
        "missed_share": (late + skipped) / periods if periods else None,
        "period_ms": _spread(us / 1e3 for us in turns if us > 0),
        "wake_late_ms": _spread(tick.late_us / 1e3 for tick in lived),
        "busy_ms": _spread(tick.busy_us / 1e3 for tick in lived),
        "observation_age_ms": _spread(max(0.0, age) for age in ages_ms),
    }


def _elections(
    lived: Sequence[Lived], clock: Clock, scenario: dict[str, Any], epochs: int | None
) -> dict[str, Any]:
    if epochs is None:
        return {"epochs_decided": None, "epochs_missed": None, "decision_ms": _spread(())}
    period_ticks = scenario["election"]["period_ticks"]
    decided_ms = {}
    for tick in lived:
        epoch = tick.slot * clock.ticks_per_period // period_ticks
        if tick.marks & Mark.LATCHED and epoch < epochs:
            began_ms = epoch * period_ticks * clock.tick_ms
            decided_ms[epoch] = clock.said_ms(tick) - began_ms
    return {
        "epochs_decided": len(decided_ms),
        "epochs_missed": epochs - len(decided_ms),
        "decision_ms": _spread(decided_ms.values()),
    }


def _torque_ages_ms(
    records: Sequence[TickRecord], board: int, said_ms: dict[int, float], tick_ms: float
) -> list[float]:
    """Age of the torque in force at the beginning of each tick."""
    ages = []
    for record in records:
        if record.answers[board]:
            said_tick = decode(TorqueFrame, record.answers[board]).tick
            ages.append(record.tick * tick_ms - said_ms.get(said_tick, said_tick * tick_ms))
    return [max(0.0, age) for age in ages]


def _stale_ticks(records: Sequence[TickRecord], board: int) -> int:
    """Ticks in which the torque of a board was too old to be applied."""
    stale, ticks = False, 0
    for record in records:
        for event in record.events:
            if event[0] in ("torque_stale", "torque_fresh") and event[1] == board:
                stale = event[0] == "torque_stale"
            elif event[0] == "gone" and event[1] == board:
                stale = False
        ticks += stale
    return ticks


def _neighbour_ages_ms(
    lived: Sequence[Lived], link: int, clock: Clock, said_ms: dict[int, float]
) -> list[float]:
    """Time since the newest frame of a neighbour had been said, whenever a tick began."""
    ages = []
    for tick in lived:
        said_tick = tick.taken[link].newest_tick
        if said_tick != NO_TICK:
            ages.append(clock.woke_ms(tick) - said_ms.get(said_tick, said_tick * clock.tick_ms))
    return [max(0.0, age) for age in ages]


def _spread(values: Iterable[float]) -> Spread:
    """The median, the 99th percentile and the largest; None of nothing."""
    found = np.fromiter(values, dtype=np.float64)
    if not found.size:
        return {"p50": None, "p99": None, "max": None}
    p50, p99, most = np.percentile(found, [50.0, 99.0, 100.0])
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(most), 3)}
