"""The folder for the results of a run, or of anything else that a command makes."""

import time
from contextlib import suppress
from itertools import count
from pathlib import Path

from deploy.launch.processes import SPOOL, RunFailedError
from protocol.process.exit_codes import ExitCode

RUNS = Path("runs")


def new_folder(out: Path | None, name: str) -> Path:
    """Make the folder for a run's results. Raises `RunFailedError` if that cannot be."""
    folder = out or RUNS
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if out is None:
            folder = _folder_of_its_own(f"{name}-{time.strftime('%Y%m%d-%H%M%S')}")
        if any(folder.iterdir()):
            raise RunFailedError(
                ExitCode.NO_OUTPUT, f"{folder} is not empty; choose another folder with --out"
            )
        (folder / SPOOL).touch()
        (folder / SPOOL).unlink()
    except OSError as error:
        raise RunFailedError(
            ExitCode.NO_OUTPUT, f"cannot write to {folder}: {error.strerror}; choose another --out"
        ) from error
    return folder


def _folder_of_its_own(name: str) -> Path:
    """Make a folder that nobody else has, also when another run begins in the same second."""
    for number in count(1):
        folder = RUNS / (name if number == 1 else f"{name}-{number}")
        with suppress(FileExistsError):
            folder.mkdir()
            return folder
    raise AssertionError("numbers have no end")
