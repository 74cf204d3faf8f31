"""The body of a decmesh robot: dynamics, sensors, and the lockstep in which the boards drive it.

Rule 1: the plant owns the tick. Boards answer it; none of them knows the whole body.
Rule 2: no BLAS and no threads in the loop, so that a trajectory is the same to the bit.
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
