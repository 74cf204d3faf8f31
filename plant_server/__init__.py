"""The body: its dynamics, its sensors, and the lockstep in which the boards drive it.

Rule 1: the plant owns the tick. Boards answer it; none of them knows the whole body.
Rule 2: no BLAS and no threads in the loop, so that a trajectory is the same to the bit.
"""

import protocol  # noqa: F401 - it looks whether what is compiled is what is written
