"""Where a recording is: in a run's folder, its `run.mcap`, or the spool that it is made from."""

from pathlib import Path

from deploy.failure import FailedError
from plant_server.spool import Spool, read_spool
from protocol.exit_codes import ExitCode


class UnreadableError(FailedError):
    """A file that is no recording, or not of this version."""

    def __init__(self, line: str) -> None:
        super().__init__(ExitCode.BAD_INPUT, line)


def read_spool_of(path: Path) -> Spool:
    """Read what was recorded; raises `UnreadableError`."""
    try:
        return read_spool(path / "run.spool" if path.is_dir() else path)
    except (OSError, ValueError) as error:
        raise UnreadableError(str(error)) from error
