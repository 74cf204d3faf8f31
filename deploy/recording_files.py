"""Where a recording is, and whether it is one: a run's folder, its `run.mcap`, or a spool.

Rule: what is read from outside is checked here, so that nobody after has to. A file that is none of
ours, not whole or of another version is the user's affair: one line, and an exit code.
"""

from pathlib import Path

from deploy.failure import FailedError
from deploy.mcap_file import read_mcap
from deploy.processes import SPOOL
from module_agent.config import board_config
from plant_server.config import plant_config
from plant_server.record import TickRecord
from plant_server.spool import Spool, read_spool
from protocol.exit_codes import ExitCode
from protocol.scenario import KEYS

MCAP = "run.mcap"
HINTS_MAX = 3
"""How many folders are named that hold what was looked for."""
MCAP_MAGIC = b"\x89MCAP0\r\n"


class UnreadableError(FailedError):
    """A file that is no recording, not whole, or not of this version."""

    def __init__(self, line: str) -> None:
        super().__init__(ExitCode.BAD_INPUT, line)


def recording_file(path: Path) -> Path:
    """The recording that a user means by a file or a run's folder; raises `UnreadableError`."""
    if not path.is_dir():
        return path
    for name in (MCAP, SPOOL):
        if (path / name).exists():
            return path / name
    inner = sorted(
        str(part) for part in path.iterdir() if (part / MCAP).exists() or (part / SPOOL).exists()
    )
    more = ["..."] if len(inner) > HINTS_MAX else []
    hint = f"; there are some in {', '.join(inner[:HINTS_MAX] + more)}" if inner else ""
    raise UnreadableError(f"{path} holds no recording, neither {MCAP} nor {SPOOL}{hint}")


def is_mcap(file: Path) -> bool:
    """Whether a file is MCAP, and not a spool. Raises OSError."""
    with file.open("rb") as opened:
        return opened.read(len(MCAP_MAGIC)) == MCAP_MAGIC


def read_spool_of(path: Path, *, whole: bool = True) -> Spool:
    """Read what was recorded; without `whole`, of a damaged file what comes before the damage.

    Raises `UnreadableError`.
    """
    file = recording_file(path)
    try:
        spool = read_mcap(file, whole=whole) if is_mcap(file) else read_spool(file)
        _check(spool)
    except OSError as error:
        raise UnreadableError(f"cannot read {file}: {error.strerror}") from error
    except (ValueError, TypeError, LookupError) as error:
        raise UnreadableError(f"{file} is no recording that can be used: {error}") from error
    return spool


def _check(spool: Spool) -> None:
    """Whether everything is there and of the right shape; raises ValueError and the like."""
    lacking = sorted(KEYS - set(spool.scenario))
    if lacking:
        raise ValueError(f"its scenario has no {lacking[0]!r}")
    joints = plant_config(spool.scenario).joints
    for joint in joints:
        board_config(spool.scenario, joint)
    if not spool.ticks:
        raise ValueError("it ends before its first tick")
    for i, record in enumerate(spool.ticks, spool.ticks[0].tick):
        if record.tick != i:
            raise ValueError(f"after tick {i - 1} comes tick {record.tick}")
        _check_tick(record, len(joints))


def _check_tick(record: TickRecord, joints: int) -> None:
    sizes = {len(part) for part in record[1:5]}
    if sizes != {joints}:
        raise ValueError(f"tick {record.tick} is not of {joints} joints")
    for event in record.events:
        if type(event) is not list or not event or type(event[0]) is not str:
            raise ValueError(f"tick {record.tick} has {event!r} for an event")
