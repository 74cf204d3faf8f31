"""What a network may do that must change nothing: order, doubles, old frames, bytes from nobody.

It draws from a seed of its own, so that a run with and one without it can be compared to the bit.
"""

from collections import defaultdict, deque
from collections.abc import Callable
from math import inf, nan
from random import Random
from typing import TypeVar

from module_agent.firmware.board import Board
from plant_server.session.lockstep import Lockstep
from protocol.wire.frames import (
    NO_TICK,
    AnyFrame,
    LinkFrame,
    ProtocolError,
    TorqueFrame,
    decode,
    encode,
)

Item = TypeVar("Item")
KEPT_FRAMES = 40
PLANT = -1
FORGED_AHEAD_TICKS = (2, 3, 7, 2**31 - 1)


class Noise:
    """Harmless mischief; a quiet one does nothing."""

    def __init__(self, seed: int, rate: float, *, quiet: bool) -> None:
        self.chance = Random(f"noise {seed}")
        self.quiet = quiet
        self._rate = 0.0 if quiet else rate
        self._past: dict[tuple[int, int], deque[bytes]] = defaultdict(
            lambda: deque(maxlen=KEPT_FRAMES)
        )
        """By key: a frame says who sent it by the key that it comes on, and on no other."""

    def shuffled(self, items: list[Item]) -> list[Item]:
        """The same in another order."""
        return items if self.quiet else self.chance.sample(items, len(items))

    def happens(self) -> bool:
        """Toss a coin; a quiet one never falls on heads."""
        return not self.quiet and self.chance.random() < 0.5

    def remember(self, sender: int, receiver: int, payload: bytes) -> None:
        """Keep a frame, to say it again when it is stale."""
        if self._rate:
            self._past[sender, receiver].append(payload)

    def disturb_board(self, board: Board) -> None:
        """Bytes from nobody arrive at a board's links."""
        for link, sender in enumerate(board.config.neighbours):
            if self._rate and self.chance.random() < self._rate:
                past = self._past[sender, board.config.index]
                for _ in range(self.chance.choice((1, 1, 2, 6))):
                    board.hear(link, self._garbage(past, self._forged_link))

    def disturb_plant(self, lockstep: Lockstep) -> None:
        """Bytes from nobody arrive at the plant's keys."""
        for board in range(lockstep.plant.size):
            if self._rate and self.chance.random() < self._rate:
                past = self._past[board, PLANT]
                lockstep.answer(board, self._garbage(past, self._forged_torque))

    def _garbage(
        self, past: deque[bytes], forged: Callable[[LinkFrame | TorqueFrame], AnyFrame]
    ) -> bytes:
        chance = self.chance
        if not past or chance.random() < 0.1:
            return chance.randbytes(chance.choice((0, 1, 4, 40, 256, 257)))
        payload = chance.choice(past)
        match chance.randrange(4):
            case 0:
                return payload
            case 1:
                return payload[: chance.randrange(len(payload))]
            case 2:
                damaged = bytearray(payload)
                damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
                return bytes(damaged)
            case _:
                return encode(forged(_decoded(payload)))

    def _forged_link(self, frame: LinkFrame | TorqueFrame) -> AnyFrame:
        """Well-formed, and wrong in one thing that a receiver can see."""
        if not isinstance(frame, LinkFrame):
            return frame
        return self.chance.choice(
            (
                frame._replace(run_id=frame.run_id ^ 1),
                frame._replace(incarnation=frame.incarnation + 1000, urgency=1e5),
                frame._replace(incarnation=0, urgency=1e5),
                frame._replace(tick=self._wrong_tick(frame.tick), urgency=1e5),
                frame._replace(urgency=self.chance.choice((nan, inf, -1.0, 1e300))),
                frame._replace(candidate=self.chance.choice((-1, 99))),
                frame._replace(com_x_m=nan),
                frame._replace(mass_kg=-1.0),
            )
        )

    def _forged_torque(self, frame: LinkFrame | TorqueFrame) -> AnyFrame:
        if not isinstance(frame, TorqueFrame):
            return frame
        return self.chance.choice(
            (
                frame._replace(run_id=frame.run_id ^ 1),
                frame._replace(incarnation=frame.incarnation + 1000),
                frame._replace(incarnation=0),
                frame._replace(tick=self._wrong_tick(frame.tick), torque_nm=1e5),
                frame._replace(tick=NO_TICK),
                frame._replace(candidate=99),
                frame._replace(state=0),
            )
        )

    def _wrong_tick(self, tick: int) -> int:
        return min(tick + KEPT_FRAMES + self.chance.choice(FORGED_AHEAD_TICKS), 2**31 - 1)


def _decoded(payload: bytes) -> LinkFrame | TorqueFrame:
    try:
        return decode(LinkFrame, payload)
    except ProtocolError:
        return decode(TorqueFrame, payload)
