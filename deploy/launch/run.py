"""One run, in processes or in the twin, from a scenario to a folder with its results."""

import sys
import time
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

from deploy.launch.processes import SPOOL, LaunchWatch, Processes, RunFailedError
from deploy.launch.rigs import NoPortsError, claim
from deploy.launch.twin import Twin
from plant_server.session.record import STOPPED, fall_line
from plant_server.spool.facts import facts
from plant_server.spool.spool import SpoolWriter
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError, undisturbed
from protocol.robot.events import BoardFault
from protocol.robot.scenario import Scenario

SUMMARY = "summary.json"


def run(
    scenario: Scenario,
    folder: Path,
    *,
    twin: bool,
    watch: LaunchWatch,
    plant_options: Sequence[str] = (),
) -> int:
    """Run a scenario and leave its spool in `folder`; return the exit code of the run.

    Raises `RunFailedError` when it could not be run to an end of its own.
    """
    if twin:
        return _run_twin(scenario, folder, watch)
    try:
        with (
            claim(scenario, folder) as placed,
            Processes(placed, folder, watch, plant_options) as processes,
        ):
            return processes.wait()
    except NoPortsError as error:
        raise RunFailedError(ExitCode.NO_NETWORK, str(error)) from error


def _run_twin(scenario: Scenario, folder: Path, watch: LaunchWatch) -> int:
    twin = Twin(scenario)
    started = time.monotonic()
    stopped = None
    with (
        SpoolWriter(folder / SPOOL, scenario, facts("twin"), watch.on_line) as spool,
        redirect_stdout(sys.stderr),  # What a controller prints is none of our output.
    ):
        try:
            while not twin.lockstep.plant.over:
                twin.think()  # Somebody's controller may never come back: Ctrl-C ends it.
                with undisturbed:
                    record = twin.lockstep.close()
                    spool.append(record, None)
                if record.tick == 0:
                    started = time.monotonic()
                watch.on_tick(record.tick)
                for event in record.events:
                    if isinstance(event, BoardFault):
                        watch.on_line(_fault_line(twin, record.tick, event.board))
        except StoppedError:
            stopped = STOPPED
        outcome = twin.lockstep.plant.outcome(time.monotonic() - started, stopped)
        spool.close(outcome)
    if stopped is not None:
        raise StoppedError
    if not twin.lockstep.plant.body.fallen:
        return ExitCode.OK
    watch.on_line(fall_line(outcome, scenario.run.tick_s))
    return ExitCode.FELL


def _fault_line(twin: Twin, tick: int, board: int) -> str:
    """What a board process would have said of its failure."""
    firmware = twin.boards[board]
    assert firmware is not None
    assert firmware.fault is not None
    fault = firmware.fault
    return f"{firmware.config.joint}: fault {fault.code} in tick {tick}\n{fault.trace}"
