"""dora-rs: every role is a node of a dataflow, started and connected by `dora run`."""

from collections import deque

import dora
import pyarrow as pa

from tests.bench.job import Place, partners


class Dora:
    """One thread: it takes events until the frame is there that it waits for."""

    def __init__(self, place: Place, role: int) -> None:
        self._node = dora.Node()
        self._heard: dict[str, deque[bytes]] = {
            f"from_{other}": deque() for other in partners(role, place.boards)
        }

    def put(self, receiver: int, frame: bytes) -> None:
        """Send an output."""
        self._node.send_output(f"to_{receiver}", pa.array(memoryview(frame), pa.uint8()))

    def get(self, sender: int) -> bytes:
        """Wait for an input."""
        heard = self._heard[f"from_{sender}"]
        while not heard:
            event = self._node.next()
            if event is None:
                raise EOFError("the dataflow is over")
            if event["type"] == "INPUT":
                self._heard[event["id"]].append(event["value"].to_numpy().tobytes())
        return heard.popleft()

    def close(self) -> None:
        """Leave it to the end of the process."""


open_endpoint = Dora
