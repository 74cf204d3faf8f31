"""One joint board's firmware: the DEC loop and the election, as a microcontroller would run them.

Rule 1: a board is scalar. Only `math`; no numpy, no clock, no randomness, no I/O outside `runtime`.
Rule 2: a board knows its own link, its own sensors, and what its neighbours said. Nothing else.
"""

import protocol  # noqa: F401 - it looks whether what is compiled is what is written
