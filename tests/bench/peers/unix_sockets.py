"""Unix sockets, one for each pair of roles: the floor of what a kernel asks for passing frames."""

import socket
import time

from tests.bench.job import FRAME_BYTES, LOOK_EVERY_S, Place, partners


class UnixSockets:
    """Sequenced packets: a frame is received as it was sent."""

    def __init__(self, place: Place, role: int) -> None:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        listener.bind(str(place.folder / f"socket-{role}"))
        listener.listen()
        self._links: dict[int, socket.socket] = {}
        others = partners(role, place.boards)
        for other in (other for other in others if other < role):
            self._links[other] = _dial(place, other)
            self._links[other].send(bytes([role]))
        for _ in (other for other in others if other > role):
            link, _address = listener.accept()
            self._links[link.recv(1)[0]] = link
        listener.close()

    def put(self, receiver: int, frame: bytes) -> None:
        """Send a frame."""
        self._links[receiver].send(frame)

    def get(self, sender: int) -> bytes:
        """Wait for a frame."""
        return self._links[sender].recv(FRAME_BYTES)

    def close(self) -> None:
        """Close every link."""
        for link in self._links.values():
            link.close()


def _dial(place: Place, other: int) -> socket.socket:
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    while True:
        try:
            link.connect(str(place.folder / f"socket-{other}"))
        except (FileNotFoundError, ConnectionRefusedError):
            time.sleep(LOOK_EVERY_S)
        else:
            return link


open_endpoint = UnixSockets
