"""Brings one board onto the network and keeps it there until its part is over."""

import json
import os
import sys
from typing import Any, NoReturn

import zenoh

from module_agent.custom import sandbox
from module_agent.firmware.config import BoardConfig, board_config
from module_agent.firmware.enrolling import FinishedError, UnansweredError
from module_agent.process.lockstep import BoardLockstepLoop
from module_agent.process.network import BoardNetwork, LockstepInbox
from module_agent.process.own_time import BoardOwnTimeLoop, OwnTimeInbox
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import ignore_signals, restarted_when_stuck
from protocol.robot.scenario import Scenario
from protocol.wire.wiring import Rig, board_session, network_trouble, rig_of, set_runtime_threads


def serve(joint: str, scenario: Scenario) -> int:
    """Run the board of a joint over Zenoh until its part is over; return the exit code.

    Raises `stopping.StoppedError` when it is told to stop, and `ScenarioError` when a
    controller's file is not the one that the scenario means.
    """
    config = board_config(scenario, joint)
    sandbox.check(config)
    set_runtime_threads()
    try:
        _live(config, scenario, rig_of(scenario))
    except FinishedError as finished:
        if finished.code != ExitCode.OK:
            print(f"{joint}: {finished}", file=sys.stderr)
        return finished.code


def _live(config: BoardConfig, scenario: Scenario, rig: Rig) -> NoReturn:
    """Play the board's part, in one session after another if the plant does not answer."""
    boot = int.from_bytes(os.urandom(8), "little") >> 1
    loop: BoardLockstepLoop | BoardOwnTimeLoop | None = None
    while True:
        with restarted_when_stuck():
            session, trouble = _join(config, rig)
        with session:
            try:
                loop = _placed(loop, session, config, scenario, rig, boot=boot, trouble=trouble)
                loop.run()
            except UnansweredError:
                continue
            except BaseException:
                ignore_signals()  # Nothing may come between the end and the closing of the session.
                raise


def _placed(
    loop: BoardLockstepLoop | BoardOwnTimeLoop | None,
    session: zenoh.Session,
    config: BoardConfig,
    scenario: Scenario,
    rig: Rig,
    *,
    boot: int,
    trouble: str | None,
) -> BoardLockstepLoop | BoardOwnTimeLoop:
    """The loop of this board at its place in a session: the one that it has had, or its first."""
    if config.cadence is None:
        inbox = LockstepInbox(len(config.neighbours))
        with restarted_when_stuck():
            network = BoardNetwork(session, inbox, config, rig=rig.name, boot=boot)
        if isinstance(loop, BoardLockstepLoop):
            loop.move(network, inbox, trouble)
            return loop
        return BoardLockstepLoop(network, inbox, config, scenario, rig, trouble=trouble)
    own_inbox = OwnTimeInbox(config)
    with restarted_when_stuck():
        network = BoardNetwork(session, own_inbox, config, rig=rig.name, boot=boot)
    if isinstance(loop, BoardOwnTimeLoop):
        loop.move(network, own_inbox, trouble)
        return loop
    return BoardOwnTimeLoop(network, own_inbox, config, scenario, rig, trouble=trouble)


def _join(config: BoardConfig, rig: Rig) -> tuple[zenoh.Session, str | None]:
    """A session; and with it what is wrong, if no neighbour can reach it."""
    try:
        return _open(board_session(rig, config.index)), None
    except zenoh.ZError as error:
        # Perhaps another process drives this joint already. The plant knows.
        trouble = network_trouble(rig.endpoint(1 + config.index), str(error))
        return _open(board_session(rig, config.index, listens=False)), trouble


def _open(config: dict[str, Any]) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
