"""A run in one JSON object: what was run, what came out, and with which versions.

`SummaryKeys` lists what is in it; `deploy.outcome.indices` defines the numbers. What never
happened, or is no number, is null.
"""

import json
import os
import tempfile
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypedDict

import numpy as np

from deploy.outcome.foot_margin import foot_margin
from deploy.outcome.indices import all_indices, counted, elections, energy
from deploy.outcome.realtime_summary import RealtimeKeys, realtime_summary
from deploy.recording.epochs import Epochs
from deploy.recording.realtime_times import RealtimeTimes
from deploy.recording.trajectory import Trajectory
from plant_server.spool.facts import versions
from protocol.robot.events import BoardFault

Summary = dict[str, Any]
Mode = Literal["processes", "twin"]


class SummaryKeys(TypedDict):
    """The keys of `summary.json`."""

    scenario: str
    """Name of the scenario."""
    seed: int
    """Seed of everything random."""
    mode: Mode
    """`processes` or `twin`."""
    controller: Literal["distributed", "original"]
    """`original`: all boards move; `distributed`: they elect the one that moves."""
    ending: str
    """`complete`, `fell`, `stopped`, or another reason; `cut off`: the recording ends early."""
    ticks: int
    """Ticks after the release of the body."""
    simulated_s: float
    """Their time."""
    wall_s: float
    """How long they took."""
    ticks_per_s: float | None
    """Ticks per second of wall time."""
    state_sha256: str
    """Digest of the motion: per tick angles, rates and applied torques, then the last state."""
    logical_sha256: str | None
    """Digest of what processes and twin have in common: no wall time, no host."""
    indices: dict[str, dict[str, Any]]
    """Of each controlled variable, by name."""
    energy_j: dict[str, Any]
    """Mechanical work of all joints over the run."""
    consensus: dict[str, Any] | None
    """What the boards agreed on, epoch by epoch; null without elections."""
    realtime: RealtimeKeys | None
    """How the boards kept their time; null in lockstep."""
    faults: list[dict[str, Any]]
    """Boards whose controller or election failed: joint, tick, code, text."""
    degraded: list[dict[str, Any]]
    """Boards that asked for a torque that is not finite: joint, first tick, number of ticks."""
    foot: dict[str, Any] | None
    """How close the body came to tipping over its foot; null without one."""
    versions: dict[str, str | None]
    """Of Python, decmesh and the libraries that a trajectory depends on."""


def summary(
    trajectory: Trajectory,
    *,
    mode: Mode,
    logical_sha256: str | None = None,
    realtime: RealtimeTimes | None = None,
    epochs: Epochs | None = None,
) -> Summary:
    """Sum up a run; see `SummaryKeys`. The digest is that of its recording.

    Epochs are found in the trajectory, unless the recording has named them already.
    """
    scenario, wall_s = trajectory.scenario, trajectory.wall_s
    agreed = elections(trajectory) if epochs is None else counted(epochs)
    foot = foot_margin(trajectory)
    values: SummaryKeys = {
        "scenario": scenario.name,
        "seed": scenario.run.seed,
        "mode": mode,
        "controller": "distributed" if scenario.election.enabled else "original",
        "ending": trajectory.ending,
        "ticks": trajectory.ticks,
        "simulated_s": trajectory.ticks * trajectory.tick_s,
        "wall_s": wall_s,
        "ticks_per_s": trajectory.ticks / wall_s if wall_s > 0.0 else None,
        "state_sha256": trajectory.state_sha256,
        "logical_sha256": logical_sha256,
        "indices": {name: found._asdict() for name, found in all_indices(trajectory).items()},
        "energy_j": energy(trajectory)._asdict(),
        "consensus": agreed and agreed._asdict(),
        "realtime": None if realtime is None else realtime_summary(realtime, trajectory.joints),
        "faults": [
            {
                "joint": scenario.joints[event.board],
                "tick": tick,
                "code": int(event.code),
                "text": event.text,
            }
            for tick, event in trajectory.events
            if isinstance(event, BoardFault)
        ],
        "degraded": list(_degraded(trajectory)),
        "foot": foot and foot._asdict(),
        "versions": versions(),
    }
    finite: Summary = _finite(values)
    return finite


def _degraded(trajectory: Trajectory) -> Iterator[dict[str, Any]]:
    """Boards whose torque was no number, so that the plant had to make do without."""
    refused = ~np.isfinite(trajectory.asked_nm)
    for joint, ticks in zip(trajectory.joints, refused.T, strict=True):
        if ticks.any():
            yield {"joint": joint, "tick": int(ticks.argmax()), "ticks": int(ticks.sum())}


def write_summary(path: Path, values: Summary) -> None:
    """Write a summary as JSON, whole or not at all. Raises OSError."""
    text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    with tempfile.NamedTemporaryFile(
        "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
    ) as file:
        unfinished = Path(file.name)
        try:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
            unfinished.chmod(0o644)  # Temporary files are private; this one is a result.
            unfinished.replace(path)
        except BaseException:
            unfinished.unlink(missing_ok=True)
            raise


def _finite(value: Any) -> Any:
    """The same values with None in place of every float that JSON cannot write."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and not isfinite(value) else value
