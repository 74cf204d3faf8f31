"""How a run in realtime kept its time, summed up: the key `realtime` of `summary.json`."""

from typing import TypedDict

import numpy as np

from deploy.recording.realtime_times import OwnTimeBoardTimes, RealtimeTimes
from deploy.recording.trajectory import Floats

Spread = dict[str, float | None]
"""p50, p99 and max."""


class DeadlineKeys(TypedDict):
    """What became of a board's deadlines; times as p50, p99 and max."""

    rate_hz: float
    """Of its loop."""
    periods: int
    """Periods that there were; each is in time, late or skipped."""
    in_time: int
    """Its torque was sent before the end of the period."""
    late: int
    """Its torque was sent after that, or the period was made up for."""
    skipped: int
    """The period was left out, because the board was late for it."""
    missed_share: float | None
    """Late and skipped periods, of all."""
    period_ms: Spread
    """From the beginning of one pass of the loop to the next."""
    wake_late_ms: Spread
    """From the beginning of a period to that of the loop's pass."""
    busy_ms: Spread
    """From then until the torque was sent: computing, interruptions included."""
    observation_age_ms: Spread
    """Age of the observation when it was used."""


class ElectionKeys(TypedDict):
    """How a board's elections went."""

    epochs_decided: int | None
    """Epochs whose last round the board played; null without elections."""
    epochs_missed: int | None
    """The other epochs."""
    decision_ms: Spread
    """From the beginning of an epoch, by the board's own clock, to its decision."""


class BoardKeys(DeadlineKeys, ElectionKeys):
    """How one board kept its time, since the release of the body."""

    torque_age_ms: Spread
    """Age of the torque that the plant applied, at each tick."""
    torque_stale_ticks: int
    """Ticks in which it was too old, so that 0 N m were applied."""
    neighbour_age_ms: dict[str, Spread]
    """By neighbour, while it was there: age of its newest link frame."""


class RealtimeKeys(TypedDict):
    """How a run in realtime kept its time."""

    missed_share: float | None
    """Missed deadlines, of all deadlines of all boards."""
    missed: str
    """What boards do about a missed deadline: `skip` or `catch-up`."""
    round_ms: float
    """Length of a round of an election."""
    behind_ms_max: float | None
    """The most that the plant was late for a tick; null: the recording ends before the run."""
    slipped_s: float | None
    """Wall time that the plant gave up, because it was more than 0.1 s late."""
    boards: dict[str, BoardKeys]
    """By joint."""


def realtime_summary(times: RealtimeTimes, joints: list[str]) -> RealtimeKeys:
    """Sum up how boards kept their time."""
    boards: dict[str, BoardKeys] = {}
    for joint, board in zip(joints, times.boards, strict=True):
        boards[joint] = {
            **_deadlines(board),
            **_elections(board, times.epochs),
            "torque_age_ms": _spread(board.torque_age_ms),
            "torque_stale_ticks": board.torque_stale_ticks,
            "neighbour_age_ms": {
                joints[other]: _spread(ages_ms) for other, ages_ms in board.neighbour_age_ms.items()
            },
        }
    missed = sum(board.missed for board in times.boards)
    return {
        "missed_share": _share(missed, sum(board.periods for board in times.boards)),
        "missed": times.policy,
        "round_ms": times.round_ms,
        "behind_ms_max": times.behind_ms_max,
        "slipped_s": times.slipped_s,
        "boards": boards,
    }


def _deadlines(board: OwnTimeBoardTimes) -> DeadlineKeys:
    late, skipped = int(board.late.sum()), int(board.skipped.sum())
    return {
        "rate_hz": board.rate_hz,
        "periods": board.periods,
        "in_time": len(board.late) - late,
        "late": late,
        "skipped": skipped,
        "missed_share": _share(board.missed, board.periods),
        "period_ms": _spread(board.period_ms),
        "wake_late_ms": _spread(board.wake_late_ms),
        "busy_ms": _spread(board.busy_ms),
        "observation_age_ms": _spread(board.observation_age_ms),
    }


def _elections(board: OwnTimeBoardTimes, epochs: int | None) -> ElectionKeys:
    decided_ms = board.decision_ms[np.isfinite(board.decision_ms)]
    return {
        "epochs_decided": None if epochs is None else len(decided_ms),
        "epochs_missed": None if epochs is None else epochs - len(decided_ms),
        "decision_ms": _spread(decided_ms),
    }


def _share(part: int, of: int) -> float | None:
    return part / of if of else None


def _spread(values: Floats) -> Spread:
    """The median, the 99th percentile and the largest; None of nothing."""
    if not values.size:
        return {"p50": None, "p99": None, "max": None}
    p50, p99, most = np.percentile(values, [50.0, 99.0, 100.0])
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(most), 3)}
