"""`python -m module_agent knee --scenario paper`: one joint board."""

import argparse
import sys

from module_agent.process.serving import serve
from protocol.process.exit_codes import ExitCode, refused
from protocol.process.resolving import load
from protocol.process.stopping import StoppedError, stop_at_end_of_input, stop_on_signals
from protocol.robot.scenario import ScenarioError
from protocol.wire.enrolment import EnrolmentVerdict


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
            return refused(EnrolmentVerdict.UNKNOWN_JOINT)

        return serve(joint, scenario)
    except ScenarioError as error:
        print(error, file=sys.stderr)
        return ExitCode.BAD_INPUT
    except StoppedError:
        print(f"{joint}: stopped", file=sys.stderr)
        return ExitCode.STOPPED


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
