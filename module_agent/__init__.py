"""One joint board of decmesh: the DEC loop and the election, as a microcontroller would run them.

Rule 1: a board is scalar. Only `math`; no numpy, no clock, no randomness, no I/O outside `process`.
Rule 2: a board knows its own link, its own sensors, and what its neighbours said. Nothing else.
"""

import sys
from importlib.util import find_spec
from pathlib import Path

# Another project's package of this name may stand in the place of ours; nothing of it is executed.
_found = find_spec("protocol")
_place = "" if _found is None else _found.origin or ""
if not _place or "decmesh" not in Path(_place).read_text(encoding="utf-8"):
    print(f"the package protocol is not decmesh's here: {_place or 'missing'}", file=sys.stderr)
    sys.exit(9)  # `ExitCode.UNFIT`, which cannot be imported from there.

import protocol  # noqa: E402, F401 - it looks whether what is compiled is what is written
