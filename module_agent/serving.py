"""Brings one board onto the network and keeps it there until its part is over."""

import json
import sys
from typing import Any

import zenoh

from module_agent.config import board_config
from module_agent.realtime import RealtimeRuntime
from module_agent.runtime import FinishedError, Runtime
from protocol.exit_codes import ExitCode
from protocol.process import ignore_signals
from protocol.scenario import ResolvedScenario
from protocol.wiring import board_session, network_trouble, rig_of, set_runtime_threads


def serve(joint: str, scenario: ResolvedScenario) -> int:
    """Run the board of a joint over Zenoh until its part is over; return the exit code.

    Raises `protocol.process.StoppedError` when it is told to stop.
    """
    rig = rig_of(scenario.values)
    config = board_config(scenario.values, joint)
    kind = Runtime if config.cadence is None else RealtimeRuntime
    set_runtime_threads()
    trouble = None
    try:
        session = _open(board_session(rig, config.index))
    except zenoh.ZError as error:
        # Perhaps another process drives this joint already. The plant knows.
        trouble = network_trouble(rig.endpoint(1 + config.index), str(error))
        session = _open(board_session(rig, config.index, listens=False))
    with session:
        try:
            kind(session, config, scenario, rig, trouble=trouble).run()
        except FinishedError as finished:
            if finished.code != ExitCode.OK:
                print(f"{joint}: {finished}", file=sys.stderr)
            return finished.code
        finally:
            ignore_signals()


def _open(config: dict[str, Any]) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
