"""The control loop in C: what `make compiled` leaves beside the sources, for Python to prefer.

Rule: what was compiled does what its source says, to the bit. A source that has been changed since
is not run in its old form: whoever imports any of this ends with a line that says so.

With `DECMESH_INTERPRETED=1` the sources run, whatever lies beside them: for tests, which test what
is written, and for debuggers, which show it.
"""

import os
import sys
from collections.abc import Iterator
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    FileFinder,
    SourceFileLoader,
)
from pathlib import Path

from protocol.process.exit_codes import ExitCode

ROOT = Path(__file__).parents[2]
PACKAGES = ("protocol", "module_agent", "plant_server")
INTERPRETED = "DECMESH_INTERPRETED"
"""Environment variable: "1" runs the sources."""


def compiled(root: Path = ROOT) -> Iterator[tuple[Path, Path]]:
    """Sources that have a compiled form, each with that."""
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


def interpreted() -> bool:
    """Whether the sources are to run, whatever lies beside them."""
    return os.environ.get(INTERPRETED) == "1"


def choose() -> None:
    """See to it that what runs is what is written; to be called before anything else is imported.

    Ends this process with one line if what would run is not what is written.
    """
    if interpreted():
        sys.path_hooks.insert(0, _sources_alone)
        sys.path_importer_cache.clear()
    elif stale := changed():
        print(
            f"{min(stale).relative_to(ROOT)} has changed since it was compiled; `make compiled`"
            " makes its new form, `make interpreted` does without",
            file=sys.stderr,
        )
        sys.exit(ExitCode.BAD_INPUT)


def _sources_alone(folder: str) -> FileFinder:
    """Find sources only, in our packages; refuses any other folder, as a path hook does."""
    place = Path(folder)
    if not any(place.is_relative_to(ROOT / package) for package in PACKAGES):
        raise ImportError
    return FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES))
