"""LCM: UDP multicast on this machine, a channel for each directed pair of roles."""

from collections import deque

import lcm

from tests.bench.job import Place, partners


class Lcm:
    """One thread: it reads what comes until the frame is there that it waits for."""

    def __init__(self, place: Place, role: int) -> None:
        self._lcm = lcm.LCM(f"udpm://239.255.76.67:{place.port}?ttl=0")
        self._heard: dict[int, deque[bytes]] = {}
        others = partners(role, place.boards)
        self._channels = {other: f"{role}-{other}" for other in others}
        for other in others:
            heard = self._heard[other] = deque()
            self._lcm.subscribe(
                f"{other}-{role}", lambda _, frame, heard=heard: heard.append(frame)
            )

    def put(self, receiver: int, frame: bytes) -> None:
        """Send a frame."""
        self._lcm.publish(self._channels[receiver], frame)

    def get(self, sender: int) -> bytes:
        """Wait for a frame."""
        heard = self._heard[sender]
        while not heard:
            self._lcm.handle()
        return heard.popleft()

    def close(self) -> None:
        """Leave it to the end of the process."""


open_endpoint = Lcm
