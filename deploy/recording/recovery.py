"""Recovery: `run.mcap` of a run that could not make it, from all that is whole of its recording.

Rule: what it is made from stays, for it may hold more than could be read.
"""

from collections.abc import Callable
from pathlib import Path

from deploy.launch.processes import SPOOL
from deploy.recording.files import UnreadableError, recording_file
from deploy.recording.mcap.file import write_mcap
from deploy.recording.replay import UnplayableError
from deploy.recording.trajectory import Trajectory, recorded_trajectory
from plant_server.spool.spool import Spool
from protocol.wire.frames import ProtocolError

ENDING = ".mcap"
RECOVERED_ENDING = ".recovered.mcap"
"""A damaged file is not written over."""


def places(path: Path, folder: Path | None = None) -> tuple[Path, Path]:
    """What to recover, and where to: a folder, or beside it. Raises `UnreadableError`."""
    spool = path / SPOOL
    source = spool if spool.exists() else recording_file(path)
    damaged = source.suffix == ENDING
    target = source.with_suffix(RECOVERED_ENDING if damaged else ENDING)
    return source, target if folder is None else folder / target.name


def rescue(
    spool: Spool, target: Path, on_tick: Callable[[int], None], run: Trajectory | None = None
) -> None:
    """Write what was recorded of a run; if it is known already as arrays, with those.

    Raises `UnreadableError`, or OSError.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        write_mcap(spool, run or recorded_trajectory(spool), target, on_tick)
    except (UnplayableError, ProtocolError, OverflowError) as error:
        raise UnreadableError(f"what was recorded does not make a run: {error}") from error
