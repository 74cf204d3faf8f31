"""`python -m deploy.launch.zenoh_echo HOST PORT`: a message between two sessions of this machine.

A process of its own, for `decmesh doctor`: whatever Zenoh does here, it can be ended from outside.
"""

import json
import sys
import time
from queue import Empty, SimpleQueue

import zenoh

from module_agent.process.network import is_up, publisher
from protocol.process.exit_codes import ExitCode
from protocol.wire import keys
from protocol.wire.wiring import Rig, board_session, plant_session, set_runtime_threads

JOINT = "echo"
WITHIN_S = 5.0


def main(host: str, port: int) -> int:
    """Send one frame between two sessions set up as a plant's and a board's; print the ms."""
    set_runtime_threads()
    rig = Rig("doctor", host, port, 1)
    configs = [
        zenoh.Config.from_json5(json.dumps(c)) for c in (plant_session(rig), board_session(rig, 0))
    ]
    heard: SimpleQueue[zenoh.Sample] = SimpleQueue()
    deadline = time.monotonic() + WITHIN_S
    with zenoh.open(configs[0]) as plant, zenoh.open(configs[1]) as board:
        key = keys.observation(rig.name, JOINT)
        _heard = board.declare_subscriber(key, zenoh.handlers.Callback(heard.put, indirect=False))
        sender = publisher(plant, key)
        while not is_up(sender):
            if time.monotonic() > deadline:
                print(f"two sessions did not find each other within {WITHIN_S:g} s")
                return ExitCode.NO_NETWORK
            time.sleep(0.001)
        sent_ns = time.monotonic_ns()
        sender.put(b"are you there?")
        try:
            heard.get(timeout=WITHIN_S)
        except Empty:
            print(f"a message did not arrive within {WITHIN_S:g} s")
            return ExitCode.NO_NETWORK
        print(f"{(time.monotonic_ns() - sent_ns) / 1e6:.2f}")
    return ExitCode.OK


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
