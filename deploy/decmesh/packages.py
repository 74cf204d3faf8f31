"""Whether the packages that Python finds under our four names are those of decmesh.

Rule: nothing of a stranger's package is executed to find out.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

NAMES = ("protocol", "module_agent", "plant_server", "deploy")
OURS = "decmesh"
"""A word that stands in the first lines of each of our packages."""
UNFIT = 9
"""`ExitCode.UNFIT`, which cannot be imported from a package that may be a stranger's."""


def strangers() -> dict[str, str]:
    """Of each of our names that somebody else's package has, or nobody's: where that lies."""
    found = {name: _place(name) for name in NAMES}
    return {name: place for name, place in found.items() if not _is_ours(place)}


def complaint(name: str, place: str) -> str:
    """One line for a user whose Python finds a stranger under one of our names."""
    if not place:
        return f"the package {name} of decmesh is missing; install decmesh again"
    return (
        f"{Path(place).parent} is another project's package {name}, in the place of decmesh's; "
        "install decmesh in an environment of its own, or leave the folder that holds it"
    )


def insist_on_ours() -> None:
    """End this process with one line if a stranger's package stands in the place of one of ours."""
    for name, place in strangers().items():
        print(complaint(name, place), file=sys.stderr)
        sys.exit(UNFIT)


def _place(name: str) -> str:
    """File that importing this package would execute; empty if there is none."""
    spec = find_spec(name)
    return "" if spec is None else spec.origin or ""


def _is_ours(place: str) -> bool:
    try:
        return OURS in Path(place).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
