"""The floor: one plant and its boards over bare Zenoh, frames of 64 bytes, nothing computed.

The same number of messages in the same pattern as decmesh: an observation to each board, a link
frame to each neighbour (heard in the next tick), a torque from each board, a barrier each tick.

    python -m tests.bench.floor ROLE BASE_PORT TICKS TUNED

ROLE 0 is the plant, 1 ... 3 are boards. TUNED is 1 for the transport settings of decmesh (low
latency, no priorities, one transport thread), 0 for those that Zenoh comes with.
"""

import json
import sys
import time
from typing import Any

import zenoh

from protocol.wiring import Rig, board_session, neighbours, plant_session, set_runtime_threads

BOARDS = 3
WARM_UP_TICKS = 500
PAYLOAD = bytes(64)


def main() -> None:
    """Play one role."""
    role, base_port, ticks, tuned = (int(word) for word in sys.argv[1:])
    rig = Rig("floor", "127.0.0.1", base_port, BOARDS)
    config = plant_session(rig) if role == 0 else board_session(rig, role - 1)
    if tuned:
        set_runtime_threads()
    else:
        del config["transport"]["unicast"]["lowlatency"]
        del config["transport"]["unicast"]["qos"]
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        if role == 0:
            plant(session, ticks + WARM_UP_TICKS)
        else:
            board(session, role - 1, ticks + WARM_UP_TICKS)


def plant(session: zenoh.Session, ticks: int) -> None:
    """Put observations, wait for torques; print ticks and seconds."""
    observations = [publisher(session, f"dec/observation/{i}") for i in range(BOARDS)]
    torques = [session.declare_subscriber(f"dec/torque/{i}") for i in range(BOARDS)]
    wait_for(observations)
    started = time.perf_counter()
    for tick in range(ticks):
        if tick == WARM_UP_TICKS:
            started = time.perf_counter()
        for observation in observations:
            observation.put(PAYLOAD)
        for torque in torques:
            torque.recv().payload.to_bytes()
    print(ticks - WARM_UP_TICKS, time.perf_counter() - started)


def board(session: zenoh.Session, index: int, ticks: int) -> None:
    """Answer observations; hear each neighbour once a tick."""
    adjacent = neighbours(index, BOARDS)
    torque = publisher(session, f"dec/torque/{index}")
    links = [publisher(session, f"dec/link/{index}/{other}") for other in adjacent]
    hearings = [session.declare_subscriber(f"dec/link/{other}/{index}") for other in adjacent]
    wait_for(links)  # Only then can the plant see this board's last subscriber.
    observation = session.declare_subscriber(f"dec/observation/{index}")
    for tick in range(ticks):
        observation.recv().payload.to_bytes()
        if tick > 0:
            for hearing in hearings:
                hearing.recv().payload.to_bytes()
        for link in links:
            link.put(PAYLOAD)
        torque.put(PAYLOAD)
    time.sleep(0.2)


def publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    """Declare a publisher as decmesh does."""
    return session.declare_publisher(
        key,
        express=True,
        priority=zenoh.Priority.REAL_TIME,
        congestion_control=zenoh.CongestionControl.BLOCK,
    )


def wait_for(publishers: list[zenoh.Publisher]) -> None:
    """Wait until every publisher has its subscriber."""
    for waiting in publishers:
        status: Any = waiting.matching_status
        while not status.matching:
            time.sleep(0.005)
            status = waiting.matching_status


if __name__ == "__main__":
    main()
