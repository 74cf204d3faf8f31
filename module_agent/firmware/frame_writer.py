"""What a board says at the end of a tick: a frame to each neighbour, and the torque to the plant.

Rule 1: always exactly one frame to each neighbour, also without data: the frame is the barrier.
Rule 2: the torque frame carries receipts: what was heard of each link, what was sent, and how long
        ago each neighbour last heard this board (S18, S22).
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.firmware.body_view import BodyView
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.election import Gossip
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.kinematics import NOTHING
from protocol.robot.states import State
from protocol.wire.frames import (
    CRC_BYTES,
    FAULT_PARTS_MAX,
    FAULT_TEXT_BYTES_MAX,
    NO_TICK,
    Fault,
    LinkFrame,
    LinkUse,
    TorqueFrame,
    encode,
)

NOTHING_SEEN = (0.0,) * 7


class Doing(NamedTuple):
    """What a board does in a tick, as the plant is told."""

    torque_nm: float
    state: State
    enabled: bool
    controlled_rad: float


class Speech:
    """The mouth of one board; what it says follows from what the rest of the board knows."""

    def __init__(
        self,
        config: BoardConfig,
        hearings: Sequence[Hearing],
        view: BodyView,
        *,
        run_id: int,
        incarnation: int,
    ) -> None:
        self.run_id = run_id
        self.incarnation = incarnation
        self.view = view
        self._links = [
            (hearing, self._for_above if neighbour > config.index else self._for_below)
            for neighbour, hearing in zip(config.neighbours, hearings, strict=True)
        ]

    def to_neighbours(self, tick: int, gossip: Gossip, state: State) -> tuple[bytes, ...]:
        """This round of the election, and to each side what lies on the other side of the board."""
        epoch, round_, (urgency, candidate) = gossip
        said = []
        for hearing, body in self._links:
            sample_tick, seen = body(state)
            frame = LinkFrame(
                self.run_id,
                self.incarnation,
                tick,
                hearing.newest_tick,
                epoch,
                round_,
                urgency,
                candidate,
                sample_tick,
                *seen,
            )
            said.append(encode(frame))
        return tuple(said)

    def to_plant(
        self,
        tick: int,
        gossip: Gossip,
        doing: Doing,
        *,
        counter: int,
        counted: int,
        said: Sequence[bytes],
    ) -> bytes:
        """The torque, what the board is doing, and its receipts."""
        epoch, round_, (urgency, candidate) = gossip
        receipts = [
            LinkUse(
                hearing.heard_mask,
                int.from_bytes(payload[-CRC_BYTES:], "little"),
                hearing.unheard_ticks,
            )
            for (hearing, _), payload in zip(self._links, said, strict=True)
        ]
        frame = TorqueFrame(
            self.run_id,
            self.incarnation,
            tick,
            doing.torque_nm,
            int(doing.state),
            int(doing.enabled),
            doing.controlled_rad,
            epoch,
            round_,
            urgency,
            candidate,
            counter,
            counted,
            tuple(receipts),
        )
        return encode(frame)

    def of_fault(self, tick: int, code: int, told: str) -> tuple[bytes, ...]:
        """What has failed: as many frames as the text takes, but not all of a long one."""
        kept = told[: FAULT_PARTS_MAX * FAULT_TEXT_BYTES_MAX]
        text = "".join(
            char if " " <= char <= "~" or char == "\n" else char.encode("unicode_escape").decode()
            for char in kept
        )
        texts = [
            text[start : start + FAULT_TEXT_BYTES_MAX]
            for start in range(0, len(text), FAULT_TEXT_BYTES_MAX)
        ][:FAULT_PARTS_MAX]
        about = self.run_id, self.incarnation, tick, code
        return tuple(
            encode(Fault(*about, part, len(texts), piece)) for part, piece in enumerate(texts)
        )

    def _for_below(self, state: State) -> tuple[int, tuple[float, ...]]:
        tick, sample = self.view.for_below(state)
        if sample is None:
            return NO_TICK, NOTHING_SEEN
        joint, link, supported = sample
        return tick, (link.rad - joint.rad, link.rad_s - joint.rad_s, *supported)

    def _for_above(self, _state: State) -> tuple[int, tuple[float, ...]]:
        tick, link = self.view.for_above()
        return tick, (*link, *NOTHING)
