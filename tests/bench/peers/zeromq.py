"""ZeroMQ over ipc://, one PAIR of sockets for each pair of roles (pyzmq)."""

import zmq

from tests.bench.job import Place, partners


class ZeroMq:
    """The lower role binds, the upper one connects."""

    def __init__(self, place: Place, role: int) -> None:
        self._context = zmq.Context()
        self._links: dict[int, zmq.Socket[bytes]] = {}
        for other in partners(role, place.boards):
            link = self._context.socket(zmq.PAIR)
            lower, upper = sorted((role, other))
            address = f"ipc://{place.folder}/zmq-{lower}-{upper}"
            if role == lower:
                link.bind(address)
            else:
                link.connect(address)
            self._links[other] = link

    def put(self, receiver: int, frame: bytes) -> None:
        """Send a frame."""
        self._links[receiver].send(frame)

    def get(self, sender: int) -> bytes:
        """Wait for a frame."""
        return self._links[sender].recv()

    def close(self) -> None:
        """Close everything; what is not sent yet still goes out."""
        self._context.destroy(linger=1000)


open_endpoint = ZeroMq
