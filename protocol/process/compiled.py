"""The control loop in C: what `make compiled` leaves beside the sources, for Python to prefer.

Rule: what was compiled does what its source says, to the bit. A source that has been changed since
is not run in its old form: whoever imports any of this ends with a line that says so.
"""

import sys
from collections.abc import Iterator
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from protocol.process.exit_codes import ExitCode

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocol", "module_agent", "plant_server")


def compiled(root: Path = ROOT) -> Iterator[tuple[Path, Path]]:
    """Sources that this Python does not run, each with what it runs in its place."""
    suffixes = tuple(EXTENSION_SUFFIXES)
    for package in PACKAGES:
        for found in (root / package).rglob("*.*"):
            if found.name.endswith(suffixes):
                source = found.with_name(found.name.partition(".")[0] + ".py")
                if source.exists():  # One library is there for the others alone.
                    yield source, found


def changed(root: Path = ROOT) -> list[Path]:
    """Sources that have been changed since they were compiled."""
    return [src for src, lib in compiled(root) if src.stat().st_mtime_ns > lib.stat().st_mtime_ns]


def insist_on_current() -> None:
    """End this process with one line if what would run is not what is written."""
    if stale := changed():
        print(
            f"{min(stale).relative_to(ROOT)} has changed since it was compiled; `make compiled`"
            " makes its new form, `make interpreted` does without",
            file=sys.stderr,
        )
        sys.exit(ExitCode.BAD_INPUT)
