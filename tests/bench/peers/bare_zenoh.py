"""Bare Zenoh: the wiring of decmesh, 64 bytes in every frame, nothing computed.

As it comes, or (option `tuned`) with the settings of decmesh, and then perhaps with others:

    lowlatency      false: with priorities and fragmentation
    link            "unixsock-stream" instead of tcp
    hear            "queue": a callback into a queue, as decmesh does, instead of a channel
    express         false: frames may wait for others
    observations    "one": the plant puts one frame that every board hears
    boards          "one": a board puts one frame that plant and neighbours hear
"""

import json
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

import zenoh

from protocol.wire.wiring import Rig, board_session, plant_session, set_runtime_threads
from tests.bench.job import LOOK_EVERY_S, PLANT, Place, partners


class BareZenoh:
    """A session with a publisher and a subscriber for each partner."""

    def __init__(self, place: Place, role: int) -> None:
        options = place.options
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(_config(place, role))))
        others = partners(role, place.boards)
        self._declared: list[Any] = []
        self._get = {other: self._heard(_key(options, other, role), options) for other in others}
        keys = {other: _key(options, role, other) for other in others}
        express = options.get("express", True)
        publishers = {key: self._publisher(key, express=express) for key in set(keys.values())}
        self._put: dict[int, Callable[[bytes], Any]] = {
            other: publishers[keys[other]].put for other in others
        }
        if len(publishers) < len(others):  # One frame for all, with the last one that is put.
            last = others[-1] if role == PLANT else PLANT
            self._put = {other: self._put[other] if other == last else _silent for other in others}
        # Declared last and on the same link: who sees this one has seen the others.
        hello: Any = zenoh.handlers.RingChannel(1)
        for other in others:
            key = f"dec/hello/{other}/{role}"
            self._declared.append(self._session.declare_subscriber(key, hello))
        for other in others:
            _wait_for(self._publisher(f"dec/hello/{role}/{other}", express=True))

    def put(self, receiver: int, frame: bytes) -> None:
        """Put a frame."""
        self._put[receiver](frame)

    def get(self, sender: int) -> bytes:
        """Wait for a frame."""
        return self._get[sender]().payload.to_bytes()

    def close(self) -> None:
        """Close the session; without it the process would not end."""
        time.sleep(0.1)  # Frames that are on their way arrive.
        self._session.close()  # type: ignore[no-untyped-call]

    def _heard(self, key: str, options: dict[str, Any]) -> Callable[[], zenoh.Sample]:
        if options.get("hear") == "queue":
            queue: SimpleQueue[zenoh.Sample] = SimpleQueue()
            callback = zenoh.handlers.Callback(queue.put, indirect=False)
            self._declared.append(self._session.declare_subscriber(key, callback))
            return queue.get
        subscriber = self._session.declare_subscriber(key)
        self._declared.append(subscriber)
        return subscriber.recv

    def _publisher(self, key: str, *, express: bool) -> zenoh.Publisher:
        return self._session.declare_publisher(
            key,
            express=express,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )


def _key(options: dict[str, Any], sender: int, receiver: int) -> str:
    one = options.get("observations" if sender == PLANT else "boards") == "one"
    return f"dec/{sender}" if one else f"dec/{sender}/{receiver}"


def _config(place: Place, role: int) -> dict[str, Any]:
    options, rig = place.options, Rig("bare", "127.0.0.1", place.port, place.boards)
    config = plant_session(rig) if role == PLANT else board_session(rig, role - 1)
    unicast = config["transport"]["unicast"]
    if options.get("tuned"):
        set_runtime_threads()
    if not options.get("tuned") or options.get("lowlatency") is False:
        del unicast["lowlatency"], unicast["qos"]
    if options.get("link") == "unixsock-stream":
        for part in ("listen", "connect"):
            ports = [endpoint.rpartition(":")[2] for endpoint in config[part]["endpoints"]]
            path = f"unixsock-stream/{place.folder}/zenoh"
            config[part]["endpoints"] = [f"{path}-{port}" for port in ports]
    return config


def _silent(_frame: bytes) -> None:
    """Somebody else's frame says it."""


def _wait_for(publisher: zenoh.Publisher) -> None:
    """Wait until a publisher has its subscriber."""
    status: Any = publisher.matching_status  # The stub calls it a bool.
    while not status.matching:
        time.sleep(LOOK_EVERY_S)
        status = publisher.matching_status


open_endpoint = BareZenoh
