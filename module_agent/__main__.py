"""`python -m module_agent knee --scenario paper`: one joint board."""

import argparse
import json
import sys
from typing import Any

import zenoh

from module_agent import foreign
from module_agent.config import board_config
from module_agent.post import Post
from module_agent.runtime import FinishedError, Runtime
from protocol.enrolment import Verdict
from protocol.exit_codes import ExitCode, refused
from protocol.process import (
    StoppedError,
    ignore_signals,
    restarted_when_stuck,
    stop_at_end_of_input,
    stop_on_signals,
)
from protocol.scenario import ResolvedScenario, ScenarioError, load
from protocol.wiring import board_session, network_trouble, rig_of, set_runtime_threads


def main() -> int:
    """Start one board, and return its exit code."""
    arguments = _arguments()
    joint: str = arguments.joint
    try:
        stop_on_signals()
        if arguments.lifeline:
            stop_at_end_of_input()
        scenario = load(arguments.scenario, arguments.set)
        if joint not in scenario.joints:
            known = ", ".join(scenario.joints)
            print(f"{joint}: unknown joint; the body has {known}", file=sys.stderr)
            return refused(Verdict.UNKNOWN_JOINT)

        return serve(joint, scenario)
    except ScenarioError as error:
        print(error, file=sys.stderr)
        return ExitCode.BAD_INPUT
    except StoppedError:
        print(f"{joint}: stopped", file=sys.stderr)
        return ExitCode.STOPPED


def serve(joint: str, scenario: ResolvedScenario) -> int:
    """Run the board of a joint over Zenoh until its part is over; return the exit code.

    Raises `protocol.process.StoppedError` when it is told to stop, and `ScenarioError` when a
    controller's file is not the one that the scenario means.
    """
    rig = rig_of(scenario.values)
    config = board_config(scenario.values, joint)
    foreign.check(config)
    set_runtime_threads()
    trouble = None
    with restarted_when_stuck():
        try:
            session = _open(board_session(rig, config.index))
        except zenoh.ZError as error:
            # Perhaps another process drives this joint already. The plant knows.
            trouble = network_trouble(rig.endpoint(1 + config.index), str(error))
            session = _open(board_session(rig, config.index, listens=False))
    with session:
        try:
            with restarted_when_stuck():
                post = Post(session, config, rig=rig.name)
            Runtime(post, config, scenario, rig, trouble=trouble).run()
        except FinishedError as finished:
            if finished.code != ExitCode.OK:
                print(f"{joint}: {finished}", file=sys.stderr)
            return finished.code
        finally:
            ignore_signals()


def _open(config: dict[str, Any]) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m module_agent",
        description="One joint board: it finds its plant, enrols, and ticks until the run is over.",
        epilog="Example: python -m module_agent knee --scenario paper",
    )
    parser.add_argument("joint", help="the joint to drive, such as knee")
    parser.add_argument(
        "--scenario", required=True, help="a scenario by name, or a .toml or resolved .json file"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change one value of the scenario; the plant needs the same",
    )
    parser.add_argument("--lifeline", action="store_true", help="end when standard input ends")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
