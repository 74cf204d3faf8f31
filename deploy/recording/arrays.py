"""A recording as arrays: the trajectory, what became of every frame, and when it all happened.

Rule 1: ticks are those since the release, 0 ... T-1, as in `Trajectory`; warm-up is left out.
Rule 2: a time is a monotonic one, in nanoseconds, and 0 where it is not known: the twin has none.
        Times of two processes may be subtracted only where `clocks_shared` is true.
Rule 3: the history of a link follows the frame, by the tick in which it was said.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deploy.recording.fates import NEVER, Fate, Settled
from deploy.recording.files import UnreadableError, read_spool_of
from deploy.recording.logical_digest import logical_sha256
from deploy.recording.realtime_times import RealtimeTimes, realtime_times
from deploy.recording.reconstruction import Reconstruction
from deploy.recording.replay import Link, UnplayableError
from deploy.recording.trajectory import Trajectory, recorded_trajectory
from deploy.recording.wall_times import BoardTimes, board_times, clocks_shared, efforts, plant_times
from plant_server.spool.spool import Spool
from protocol.robot.scenario import resolved
from protocol.wire.frames import ProtocolError
from protocol.wire.wiring import neighbours

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

__all__ = ["Fate", "LinkHistory", "Recording", "read_recording"]

NOT_HEARD = -1
"""In arrays, in place of the tick in which a frame was heard."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkHistory:
    """One directed link, frame by frame; each array has one entry for the tick it was said in."""

    sent: Flags
    """Whether a frame was sent, as far as the plant got to know: its sender answered, (T,)."""
    fate: Integers
    """`Fate`, (T,)."""
    heard_tick: Integers
    """The tick in which it was first used, or `NOT_HEARD`, (T,)."""
    frame_bytes: Integers
    """Size of the frame; 0 where it is not known, as the board at that end is not ours, (T,)."""
    sent_ns: Integers
    """When its sender began to speak, on the sender's clock; 0: not known, (T,)."""
    arrived_ns: Integers
    """When it arrived at its receiver, on the receiver's clock; 0: not known, (T,)."""
    refused: dict[str, int]
    """How many frames the receiver refused, by `frames.Reason`, had the network brought
    everything once: those that the link model damaged, and those that were void. Warm-up too."""

    @property
    def bytes_sent(self) -> int:
        """Size of all frames sent."""
        return int(self.frame_bytes.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A run of T ticks with N joints, and all that is known of how it went."""

    trajectory: Trajectory
    facts: dict[str, Any]
    """Facts of the run that are not its scenario's: versions, machine, numeric fingerprint."""
    complete: bool
    """Whether the run said how it ended; else the end is missing."""
    logical_sha256: str
    """Digest of all that must be the same in processes and twin (S20)."""
    opened_ns: Integers
    """When the plant opened each tick, on its clock, (T,)."""
    answered_ns: Integers
    """When each board's answer was taken, on the plant's clock, (T, N)."""
    closed_ns: Integers
    """When the last answer had been taken, before the body moved on, (T,)."""
    taken_up_ns: Integers
    """When each board took up its observation, on its own clock, (T, N)."""
    decided_ns: Integers
    """When each board had thought the tick through, and began to speak, (T, N)."""
    said_ns: Integers
    """When each board had said everything, on its own clock, (T, N)."""
    links: dict[tuple[int, int], LinkHistory]
    """By (sender, receiver), indices of boards."""
    refused_by_network: list[dict[str, int]]
    """For each board, how many frames it refused that no link model had touched, by `Reason`."""
    processes: dict[str, tuple[float, float]]
    """CPU seconds and peak memory in MB of "plant" and of each joint's process; empty in the
    twin. Of a joint that had several boards: seconds of all, memory of the largest."""
    clocks_shared: bool
    """Whether all processes read one clock, so that a frame's way can be timed."""
    realtime: RealtimeTimes | None = None
    """How boards kept their time, of a run in realtime. Then `links` is empty: frames have no
    tick in which they ought to be heard, and so no fate; and boards tell of turns, not of ticks."""


def read_recording(path: Path) -> Recording:
    """Read a run from its folder, its `run.mcap` or its spool.

    Raises `deploy.recording.files.UnreadableError` with one line for the user.
    """
    spool = read_spool_of(path)
    try:
        return recording(spool)
    except (UnplayableError, ProtocolError, OverflowError) as error:
        raise UnreadableError(f"{path}: what was recorded does not make a run: {error}") from error


def recording(spool: Spool) -> Recording:
    """Make arrays of what was recorded, and of what a replay of it tells."""
    run = recorded_trajectory(spool)
    ticks, joints = run.ticks, len(run.joints)
    plant, boards = plant_times(spool, ticks), board_times(spool.timings, ticks, joints)
    times = realtime_times(spool)
    told = None if times else Reconstruction(resolved(spool.scenario))
    return Recording(
        trajectory=run,
        facts=spool.facts,
        complete=spool.complete,
        logical_sha256=logical_sha256(spool),
        opened_ns=plant.opened_ns,
        answered_ns=plant.answered_ns,
        closed_ns=plant.closed_ns,
        taken_up_ns=boards.taken_up_ns,
        decided_ns=boards.decided_ns,
        said_ns=boards.said_ns,
        links={} if told is None else _links(spool, run, boards, told),
        refused_by_network=[
            {} if told is None else told.refused_by_network(board) for board in range(joints)
        ],
        processes=efforts(spool),
        clocks_shared=clocks_shared(spool),
        realtime=times,
    )


def _links(
    spool: Spool, run: Trajectory, boards: BoardTimes, told: Reconstruction
) -> dict[Link, LinkHistory]:
    """The history of each directed link."""
    return {
        (sender, receiver): LinkHistory(
            sent=run.state[:, sender] > 0,
            fate=fate,
            heard_tick=heard_tick,
            frame_bytes=frame_bytes,
            sent_ns=boards.decided_ns[:, sender],
            arrived_ns=_a_tick_later(boards.arrived_ns[:, receiver, place]),
            refused=told.refused((sender, receiver)),
        )
        for (sender, receiver), (fate, heard_tick, frame_bytes) in _follow(
            spool, told, run.ticks
        ).items()
        for place in [neighbours(receiver, len(run.joints)).index(sender)]
    }


def _follow(spool: Spool, told: Reconstruction, ticks: int) -> dict[Link, list[Integers]]:
    """Fate, tick heard and size of the frames of each link, each by the tick said, (T,)."""
    frames = {
        link: [np.full(ticks, unless, np.int64) for unless in (Fate.UNSAID, NOT_HEARD, 0)]
        for link in told.links
    }

    def keep(settled: Settled) -> None:
        if 0 <= settled.said_tick < ticks:
            fate, heard_tick, _ = frames[settled.link]
            fate[settled.said_tick] = settled.fate
            if settled.heard_tick != NEVER:
                heard_tick[settled.said_tick] = settled.heard_tick

    for record in spool.ticks:
        tick = told.tick(record)
        for settled in tick.settled:
            keep(settled)
        if 0 <= record.tick < ticks:
            for link, said in tick.links.items():
                frames[link][2][record.tick] = len(said)
    for settled in told.end():
        keep(settled)
    return frames


def _a_tick_later(arrived_ns: Integers) -> Integers:
    """By the tick in which a frame was said, what is known by the tick in which it is used."""
    return np.append(arrived_ns[1:], 0)
