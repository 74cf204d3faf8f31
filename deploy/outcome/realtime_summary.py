"""How a run in realtime kept its time, summed up: the key `realtime` of `summary.json`.

missed_share        of all deadlines of all boards
boards.{joint}      rate_hz; periods, in_time, late, skipped, missed_share: what became of each
deadline; torque_stale_ticks; epochs_decided, epochs_missed;
period_ms, wake_late_ms, busy_ms, observation_age_ms, torque_age_ms,
decision_ms, and neighbour_age_ms by neighbour: p50, p99 and max
missed, round_ms    policy for missed deadlines, and how long a round of an election takes
behind_ms_max       how late the plant was for a tick, at worst
slipped_s           wall time that it gave up because it was too late
"""

from typing import Any

import numpy as np

from deploy.recording.realtime_times import BoardTimes, RealtimeTimes
from deploy.recording.trajectory import Floats

Spread = dict[str, float | None]


def realtime_summary(times: RealtimeTimes, joints: list[str]) -> dict[str, Any]:
    """Sum up how boards kept their time."""
    boards = {}
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


def _deadlines(board: BoardTimes) -> dict[str, Any]:
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


def _elections(board: BoardTimes, epochs: int | None) -> dict[str, Any]:
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
