"""`logical_sha256`: one digest of all that is the same in processes and twin (S20).

What is digested, in order, each as one msgpack array:

    scenario   the resolved scenario without its rig, as canonical JSON
    ticks      of each, warm-up included: tick, angles, rates, applied torques, torque frames as
               lists of their fields (nil: none), events
    outcome    ticks, last angles, last rates, ending, 0.0, undriven joints; nil if cut off

Rule 1: no wall time, no fact of a machine, and no count of refused frames, which is what a network
        happened to bring. It stands as 0.
Rule 2: observations and link frames follow from these: a link frame is there as its CRC-32.
"""

from collections.abc import Iterator
from hashlib import sha256
from typing import Any

import msgpack

from deploy.recording.differences import REFUSED
from plant_server.spool.spool import Spool
from protocol.robot.events import values_of
from protocol.robot.scenario import meaning
from protocol.wire.frames import TorqueFrame, decode


def logical_sha256(spool: Spool) -> str:
    """Digest a recording, as hex digits."""
    digest = sha256()
    pack = msgpack.Packer(use_bin_type=True, default=values_of).pack
    for item in _items(spool):
        digest.update(pack(item))
    return digest.hexdigest()


def _items(spool: Spool) -> Iterator[Any]:
    yield [meaning(spool.scenario)]
    for tick, *motion, answers, events in spool.ticks:
        yield [tick, *motion, [_frame(answer) for answer in answers], events]
    outcome = spool.outcome
    yield None if outcome is None else outcome._replace(wall_s=0.0)


def _frame(answer: bytes) -> TorqueFrame | None:
    if not answer:
        return None
    frame = decode(TorqueFrame, answer)
    return frame._replace(counted=0) if frame.counter in REFUSED else frame
