"""Recordings that nobody recorded: a twin's trajectory with times and fates drawn from a seed."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from deploy.launch.twin import run_twin
from deploy.recording.arrays import Flags, LinkHistory, Recording
from deploy.recording.epochs import epochs
from deploy.recording.frame_fate import FrameFate
from deploy.recording.mcap.file import write_mcap
from deploy.recording.reading import read_recording
from deploy.recording.trajectory import (
    Floats,
    Integers,
    Trajectory,
    recorded_trajectory,
    trajectory,
)
from deploy.scenario_file.load import load
from plant_server.spool.spool import Spool
from protocol.robot.events import Event, LinkChange, Push
from protocol.robot.scenario import ElectionSettings

START_NS = 5_000_000_000


@cache
def run(name: str, *settings: str) -> Trajectory:
    scenario = load(name, list(settings))
    return trajectory(scenario, *run_twin(scenario))


def read_back(of: Spool) -> Recording:
    """What the report reads of the file that is made of a spool."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        write_mcap(of, recorded_trajectory(of), path, lambda _tick: None)
        return read_recording(path)


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
        epochs=epochs(of),
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


def _link(rng: np.random.Generator, sent: Flags, said_ns: Integers) -> LinkHistory:
    ticks = len(sent)
    drawn = rng.choice(
        [FrameFate.HEARD, FrameFate.LATE, FrameFate.LOST, FrameFate.CORRUPT],
        ticks,
        p=[0.8, 0.08, 0.08, 0.04],
    )
    fate = np.where(sent, drawn, FrameFate.UNSAID).astype(np.int64)
    said = np.arange(ticks)
    heard = np.where(
        fate == FrameFate.HEARD, said + 1, np.where(fate == FrameFate.LATE, said + 3, -1)
    )
    fate[heard >= ticks] = FrameFate.PENDING
    heard[heard >= ticks] = -1
    way_ns = rng.lognormal(11.5, 0.4, ticks).astype(np.int64)
    return LinkHistory(
        sent=sent.copy(),
        fate=fate,
        heard_tick=heard,
        frame_bytes=np.where(sent, 104, 0),
        sent_ns=said_ns - (said_ns > 0) * 1000,
        arrived_ns=np.where(said_ns > 0, said_ns + way_ns, 0),
        refused={"corrupt": int((fate == FrameFate.CORRUPT).sum())},
    )


def _processes(of: Trajectory) -> dict[str, tuple[float, float]]:
    joints = of.scenario.joints
    return {name: (1.0 + i / 10, 33.0) for i, name in enumerate(["plant", *joints])}


def chain(folder: Path, boards: int, duration_s: float) -> Trajectory:
    """A line of boards that swings and elects, by no physics: for sizes that no body stands."""
    path = folder / "chain.toml"
    path.write_text(
        f"[run]\nduration_s = {duration_s}\n[election]\nrounds = {boards + 2}\n"
        '[[link]]\nlink = "all"\nloss = 0.1\n'
        + "".join(
            f'[[board]]\njoint = "joint_{i}"\ncontrols = "link-orientation"\n'
            f"imu = {str(i == boards - 1).lower()}\n[board.servo]\nkp_nm_rad = 1.0\n"
            f'kd_nm_s_rad = 1.0\n[board.link]\nname = "link_{i}"\nmass_kg = 1.0\n'
            "length_m = 0.2\ncom_m = 0.1\n"
            for i in range(boards)
        ),
        encoding="utf-8",
    )
    scenario = load(str(path))
    ticks = scenario.run.ticks
    times_s = np.arange(ticks + 1) / 1000.0
    phases = np.arange(boards)
    angles_rad = 0.05 * np.exp(-times_s / 50.0)[:, None] * np.sin(times_s[:, None] + phases)
    return Trajectory(
        scenario=scenario,
        events=_pokes(boards, ticks),
        ending="complete",
        wall_s=duration_s,
        angles_rad=angles_rad,
        rates_rad_s=np.gradient(angles_rad, 0.001, axis=0),
        torques_nm=np.ones((ticks, boards)),
        asked_nm=angles_rad[:-1],
        controlled_rad=angles_rad[:-1],
        state=np.full((ticks, boards), 2),
        **_elected(np.abs(angles_rad), scenario.election),
    )


def _pokes(boards: int, ticks: int) -> list[tuple[int, Event]]:
    """A cut, its end and a push every second, here and there."""
    found: list[tuple[int, Event]] = []
    for number, tick in enumerate(range(500, ticks, 1000)):
        low = number % (boards - 1)
        pairs = ((low, low + 1), (low + 1, low))
        found.append((tick, LinkChange(pairs, {"cut": 1.0})))
        found.append((tick + 200, Push(low, 3.0, 100)))
        found.append((tick + 400, LinkChange(pairs, {"cut": 0.0})))
    return found


def _elected(w_rad: Floats, election: ElectionSettings) -> dict[str, Any]:
    """Max-consensus on a line of boards, of which one frame in ten is lost."""
    rng = np.random.default_rng(7)
    ticks, boards = len(w_rad) - 1, w_rad.shape[1]
    epoch, round_ = np.divmod(np.arange(ticks), election.period_ticks)
    urgency = np.empty((ticks, boards))
    candidate = np.empty((ticks, boards), dtype=np.int64)
    enabled = np.ones((ticks, boards), dtype=np.int64)
    for tick in range(ticks):
        if round_[tick] == 0:
            urgency[tick], candidate[tick] = w_rad[tick], np.arange(boards)
        else:
            urgency[tick], candidate[tick] = urgency[tick - 1], candidate[tick - 1]
        if 0 < round_[tick] <= election.rounds:
            for to, of in ((slice(1, None), slice(-1)), (slice(-1), slice(1, None))):
                heard = rng.random(boards - 1) > 0.1
                better = heard & (urgency[tick - 1, of] > urgency[tick, to])
                urgency[tick, to][better] = urgency[tick - 1, of][better]
                candidate[tick, to][better] = candidate[tick - 1, of][better]
        latches = round_[tick] == election.rounds
        won = (candidate[tick] == np.arange(boards)).astype(np.int64)
        enabled[tick] = won if latches else enabled[tick - 1]
    return {
        "epoch": np.broadcast_to(epoch[:, None], (ticks, boards)),
        "round": np.broadcast_to(np.minimum(round_, election.rounds)[:, None], (ticks, boards)),
        "urgency": urgency,
        "candidate": candidate,
        "enabled": enabled,
    }
