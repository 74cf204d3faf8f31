"""Writes what a board says at the end of a tick: link frames, and the torque to the plant.

Rule 1: always exactly one frame to each neighbour, also without data: the frame is the barrier.
Rule 2: the torque frame carries receipts: what was heard of each link, what was sent, and how long
        ago each neighbour last heard this board (S18, S22).
"""

from collections.abc import Sequence
from typing import NamedTuple

from module_agent.firmware.body_view import BodyView
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.election import Gossip
from module_agent.firmware.hearing import LinkEnd
from module_agent.firmware.kinematics import NOTHING
from module_agent.firmware.own_time.translator import OwnTime
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


KnownBody = tuple[int, tuple[float, ...]]
"""What a board knows of the body on one side of it, for the neighbour on the other: the tick of the
sample (`NO_TICK`: nothing is known), and the last seven fields of a `LinkFrame`."""


class Statement(NamedTuple):
    """What a board has to say in a tick, to its neighbours and to the plant."""

    gossip: Gossip
    """Its round of the election."""
    bodies: list[KnownBody]
    """To each neighbour what lies on the other side of the board."""
    torque_nm: float
    state: State
    enabled: bool
    controlled_rad: float
    """The controlled variable alpha that the servo used."""


class FrameWriter:
    """Frames of one board, of what it has to say; with `own_time`, in the plant's ticks."""

    def __init__(
        self,
        config: BoardConfig,
        links: Sequence[LinkEnd],
        view: BodyView,
        *,
        run_id: int,
        incarnation: int,
        own_time: OwnTime | None = None,
    ) -> None:
        self.run_id = run_id
        self.incarnation = incarnation
        self.view = view
        self._own_time = own_time
        self._links = list(links)
        self._known = [
            self._for_above if neighbour > config.index else self._for_below
            for neighbour in config.neighbours
        ]

    def bodies(self, state: State) -> list[KnownBody]:
        """What there is to tell each neighbour of the body."""
        bodies = []
        for known in self._known:  # A comprehension is a call more.
            bodies.append(known(state))  # noqa: PERF401 - in every tick
        return bodies

    def to_neighbours(self, tick: int, now: Statement) -> tuple[bytes, ...]:
        """A frame to each neighbour."""
        epoch, round_, (urgency, candidate) = now.gossip
        payloads = []
        for link, (sample_tick, values) in zip(self._links, now.bodies, strict=True):
            frame = LinkFrame(
                self.run_id,
                self.incarnation,
                tick,
                link.newest_tick,
                epoch,
                round_,
                urgency,
                candidate,
                sample_tick,
                *values,
            )
            if self._own_time is not None:
                frame = self._own_time.said(frame)
            payloads.append(encode(frame))
        return tuple(payloads)

    def to_plant(
        self, tick: int, now: Statement, *, counter: int, counted: int, payloads: Sequence[bytes]
    ) -> bytes:
        """The torque, what the board is doing, and its receipts for `payloads` and what it used."""
        epoch, round_, (urgency, candidate) = now.gossip
        receipts = [
            LinkUse(
                link.heard_mask,
                int.from_bytes(payload[-CRC_BYTES:], "little"),
                link.unheard_ticks,
            )
            for link, payload in zip(self._links, payloads, strict=True)
        ]
        frame = TorqueFrame(
            self.run_id,
            self.incarnation,
            tick if self._own_time is None else self._own_time.plant_tick(tick),
            now.torque_nm,
            int(now.state),
            int(now.enabled),
            now.controlled_rad,
            epoch,
            round_,
            urgency,
            candidate,
            counter,
            counted,
            tuple(receipts),
        )
        return encode(frame)

    def of_fault(self, tick: int, code: int, trace: str) -> tuple[bytes, ...]:
        """What has failed: as many frames as the text takes, but not all of a long one."""
        kept = trace[: FAULT_PARTS_MAX * FAULT_TEXT_BYTES_MAX]
        text = "".join(
            char if " " <= char <= "~" or char == "\n" else char.encode("unicode_escape").decode()
            for char in kept
        )
        texts = [
            text[start : start + FAULT_TEXT_BYTES_MAX]
            for start in range(0, len(text), FAULT_TEXT_BYTES_MAX)
        ][:FAULT_PARTS_MAX]
        if self._own_time is not None:
            tick = self._own_time.plant_tick(tick)
        about = self.run_id, self.incarnation, tick, code
        return tuple(
            encode(Fault(*about, part, len(texts), piece)) for part, piece in enumerate(texts)
        )

    def _for_below(self, state: State) -> KnownBody:
        tick, sample = self.view.for_below(state)
        if sample is None:
            return NO_TICK, NOTHING_SEEN
        joint, link, supported = sample
        return tick, (link.rad - joint.rad, link.rad_s - joint.rad_s, *supported)

    def _for_above(self, _state: State) -> KnownBody:
        tick, link = self.view.for_above()
        return tick, (*link, *NOTHING)
