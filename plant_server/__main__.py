"""`python -m plant_server --scenario paper`: the body that the boards drive."""

import argparse
import json
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import zenoh

from plant_server.process.network import PlantNetwork
from plant_server.process.runtime import PlantOptions, assemble
from plant_server.session.record import COMPLETE, FELL, STOPPED, Outcome, fall_line
from plant_server.spool.facts import facts
from plant_server.spool.spool import SpoolWriter
from protocol.process.durations import duration_s, pace
from protocol.process.exit_codes import ExitCode
from protocol.process.resolving import load
from protocol.process.stopping import (
    StoppedError,
    ignore_signals,
    restarted_when_stuck,
    stop_at_end_of_input,
    stop_on_signals,
)
from protocol.robot.scenario import Scenario, ScenarioError
from protocol.wire.wiring import network_trouble, plant_session, rig_of, set_runtime_threads


def main() -> int:
    """Start the plant, and return its exit code."""
    arguments = _arguments()
    try:
        stop_on_signals()
        if arguments.lifeline:
            stop_at_end_of_input()
        scenario = load(arguments.scenario, arguments.set)

        options = PlantOptions(
            spool=arguments.spool,
            progress=arguments.progress,
            patience_s=arguments.patience,
            pace=arguments.pace,
        )
        return serve(scenario, options)
    except ScenarioError as error:
        print(error, file=sys.stderr)
        return ExitCode.BAD_INPUT
    except StoppedError:
        print("plant: stopped", file=sys.stderr)
        return ExitCode.STOPPED


def serve(scenario: Scenario, options: PlantOptions) -> int:
    """Run the plant over Zenoh; return the exit code.

    Raises `stopping.StoppedError` when it is told to stop before the run has begun.
    """
    rig = rig_of(scenario)
    set_runtime_threads()
    try:
        with restarted_when_stuck():
            session = zenoh.open(zenoh.Config.from_json5(json.dumps(plant_session(rig))))
    except zenoh.ZError as error:
        print(f"plant: {network_trouble(rig.endpoint(0), str(error))}", file=sys.stderr)
        return ExitCode.NO_NETWORK
    with session:
        try:
            with restarted_when_stuck():
                network = PlantNetwork(
                    session,
                    rig,
                    scenario.joints,
                    records=options.spool is not None,
                    in_realtime=scenario.realtime is not None,
                )
            with _recording(scenario, options) as writer:
                outcome = assemble(network, scenario, options, writer).run()
        except OSError as error:
            print(f"plant: cannot write {options.spool}: {error.strerror}", file=sys.stderr)
            return ExitCode.NO_OUTPUT
        finally:
            ignore_signals()
    return _report(outcome, scenario, options)


def _recording(
    scenario: Scenario, options: PlantOptions
) -> AbstractContextManager[SpoolWriter | None]:
    if options.spool is None:
        return nullcontext()
    return SpoolWriter(options.spool, scenario, facts("processes"), _tell)


def _tell(line: str) -> None:
    print(f"plant: {line}", file=sys.stderr, flush=True)


def _report(outcome: Outcome, scenario: Scenario, options: PlantOptions) -> int:
    if outcome.ending == COMPLETE:
        if not options.progress:
            rate = outcome.tick / outcome.wall_s
            print(f"plant: complete after {outcome.tick} ticks, {rate:.0f} a second")
        return ExitCode.OK
    if outcome.ending == FELL:
        print(f"plant: {fall_line(outcome, scenario.run.tick_s)}", file=sys.stderr)
        return ExitCode.FELL
    print(f"plant: {outcome.ending}", file=sys.stderr)
    return ExitCode.STOPPED if outcome.ending == STOPPED else ExitCode.PEER_LOST


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m plant_server",
        description="The body in lockstep: it waits for a board for every joint, then ticks.",
        epilog="Example: python -m plant_server --scenario paper --spool run.spool",
    )
    parser.add_argument(
        "--scenario", required=True, help="a scenario by name, or a .toml or resolved .json file"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change one value of the scenario; the boards need the same",
    )
    parser.add_argument("--spool", type=Path, help="record every tick in this file")
    parser.add_argument(
        "--progress",
        action="store_true",
        help="print tick and wall time since the release, now and then and at the end",
    )
    parser.add_argument(
        "--patience",
        type=duration_s,
        metavar="TIME",
        help="go on without a board that is silent for so long, e.g. 200ms; default: never",
    )
    parser.add_argument(
        "--pace",
        type=pace,
        metavar="FACTOR",
        help="in lockstep, go no faster than so many seconds of the body in one of the wall",
    )
    parser.add_argument("--lifeline", action="store_true", help="end when standard input ends")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
