"""What the processes of decmesh say to each other: frames, keys, and the resolved scenario.

Rule 1: standard library, msgpack and msgspec only, so that a board stays small.
Rule 2: nothing here knows what a torque does; it knows how one is written down.
"""

from protocol.process.compiled import choose

choose()
