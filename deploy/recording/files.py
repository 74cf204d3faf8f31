"""Where a recording is: a run's folder, its `run.mcap`, or a spool."""

from pathlib import Path

from deploy.failure import FailedError
from deploy.launch.processes import SPOOL
from plant_server.spool.chunks import MAGIC as SPOOL_MAGIC
from protocol.process.exit_codes import ExitCode

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
    """Whether a file is MCAP. Raises OSError."""
    return _begins_with(file, MCAP_MAGIC)


def is_spool(file: Path) -> bool:
    """Whether a file is what a plant writes while a run goes on. Raises OSError."""
    return _begins_with(file, SPOOL_MAGIC)


def _begins_with(file: Path, magic: bytes) -> bool:
    with file.open("rb") as opened:
        return opened.read(len(magic)) == magic
