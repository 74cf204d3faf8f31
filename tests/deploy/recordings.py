"""Recordings that nobody recorded: a twin's trajectory with times and fates drawn from a seed."""

from dataclasses import replace
from functools import cache

import numpy as np

from deploy.recording import Fate, LinkHistory, Recording
from deploy.scenario import load
from deploy.trajectory import Trajectory, trajectory
from deploy.twin import run_twin

START_NS = 5_000_000_000


@cache
def run(name: str, *settings: str) -> Trajectory:
    scenario = load(name, list(settings))
    return trajectory(scenario.values, *run_twin(scenario))


def recording(of: Trajectory, *, seed: int = 1, timed: bool = True) -> Recording:
    """Invent a recording of a trajectory: in processes if `timed`, else as of the twin."""
    rng = np.random.default_rng(seed)
    ticks, boards = of.torques_nm.shape
    there = of.state > 0
    whole_ns = np.asarray(rng.lognormal(13.0, 0.5, ticks), dtype=np.int64) + 100_000
    opened_ns = START_NS + np.concatenate([[0], np.cumsum(whole_ns)[:-1]]).astype(np.int64)
    closed_ns = opened_ns + (0.9 * whole_ns).astype(np.int64)
    said_ns = opened_ns[:, None] + (
        whole_ns[:, None] * rng.uniform(0.2, 0.8, (ticks, boards))
    ).astype(np.int64)
    answered_ns = said_ns + (0.05 * whole_ns).astype(np.int64)[:, None]
    unknown = np.zeros(ticks, dtype=np.int64)
    known = there & timed
    return Recording(
        trajectory=of,
        facts={"mode": "processes" if timed else "twin", "versions": {"python": "3.11"}},
        complete=True,
        logical_sha256="0" * 64,
        opened_ns=opened_ns if timed else unknown,
        answered_ns=np.where(known, answered_ns, 0),
        closed_ns=closed_ns if timed else unknown,
        taken_up_ns=np.where(known, opened_ns[:, None] + 50_000, 0),
        decided_ns=np.where(known, said_ns - 20_000, 0),
        said_ns=np.where(known, said_ns, 0),
        links={
            (a, b): _link(rng, there[:, a], np.where(known[:, a], said_ns[:, a], 0))
            for a in range(boards)
            for b in (a - 1, a + 1)
            if 0 <= b < boards
        },
        refused_by_network=[{} for _ in range(boards)],
        processes=_processes(of) if timed else {},
        clocks_shared=timed,
    )


def unfinished(of: Recording) -> Recording:
    """The same recording, killed."""
    return replace(of, complete=False)


def _link(rng: np.random.Generator, sent: np.ndarray, said_ns: np.ndarray) -> LinkHistory:
    ticks = len(sent)
    drawn = rng.choice(
        [Fate.HEARD, Fate.LATE, Fate.LOST, Fate.CORRUPT], ticks, p=[0.8, 0.08, 0.08, 0.04]
    )
    fate = np.where(sent, drawn, Fate.UNSAID).astype(np.int64)
    said = np.arange(ticks)
    heard = np.where(fate == Fate.HEARD, said + 1, np.where(fate == Fate.LATE, said + 3, -1))
    fate[heard >= ticks] = Fate.PENDING
    heard[heard >= ticks] = -1
    way_ns = rng.lognormal(11.5, 0.4, ticks).astype(np.int64)
    return LinkHistory(
        sent=sent.copy(),
        fate=fate,
        heard_tick=heard,
        frame_bytes=np.where(sent, 104, 0),
        sent_ns=said_ns - (said_ns > 0) * 1000,
        arrived_ns=np.where(said_ns > 0, said_ns + way_ns, 0),
        refused={"corrupt": int((fate == Fate.CORRUPT).sum())},
    )


def _processes(of: Trajectory) -> dict[str, tuple[float, float]]:
    joints = [board["joint"] for board in of.scenario["board"]]
    return {name: (1.0 + i / 10, 33.0) for i, name in enumerate(["plant", *joints])}
