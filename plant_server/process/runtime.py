"""A plant process: lets boards in, plays ticks until the run is over, and says goodbye."""

import time
from pathlib import Path
from typing import NamedTuple

from plant_server.process.board_processes import BoardProcesses
from plant_server.process.console import Console
from plant_server.process.lockstep_loop import PlantLockstepLoop
from plant_server.process.network import PlantNetwork
from plant_server.process.realtime_loop import PlantRealtimeLoop
from plant_server.session.config import plant_config
from plant_server.session.enrolment import Enrolment
from plant_server.session.free_running import FreeRunning
from plant_server.session.lockstep import Lockstep
from plant_server.session.pace import Pace
from plant_server.session.plant import Plant
from plant_server.session.record import STOPPED, Outcome
from plant_server.spool.recorder import Recorder
from plant_server.spool.spool import SpoolWriter
from protocol.process.stopping import StoppedError
from protocol.robot.scenario import Scenario

FAREWELL_S = 5.0
"""How long the plant waits for boards to have heard that the run is over."""
HURRIED_S = 0.5
"""The same when it was stopped: a board may be frozen, and somebody is waiting for the end."""


class PlantOptions(NamedTuple):
    """How a plant process is to behave, as its command line says."""

    spool: Path | None
    """Where to record, if anywhere."""
    progress: bool
    """Whether a launcher reads what is said on standard output."""
    patience_s: float | None
    """How long a silent board is waited for; None: for ever. Realtime waits for nobody."""
    pace: float | None = None
    """Seconds of the body in a second of the wall; None: what the scenario says."""


class PlantRuntime:
    """One plant process, from its place on the network to the end of the run."""

    def __init__(self, boards: BoardProcesses, loop: PlantLockstepLoop | PlantRealtimeLoop) -> None:
        self.boards = boards
        self.loop = loop
        self.plant = boards.driver.plant

    def run(self) -> Outcome:
        """Wait for every board, then tick to the end. Returns how the run ended."""
        try:
            self._assemble()
        except StoppedError:
            self.boards.say_goodbye(STOPPED, HURRIED_S)
            raise
        cut_short = None
        try:
            while not self.plant.over:
                self.loop.play()
        except StoppedError:
            cut_short = STOPPED
        released_s = self.loop.released_s
        wall_s = 0.0 if released_s is None else time.monotonic() - released_s
        outcome = self.plant.outcome(wall_s, cut_short)
        self._conclude(outcome)
        return outcome

    def _assemble(self) -> None:
        """Wait until all boards are here at once; then the run begins, and has its name."""
        boards, enrolment = self.boards, self.boards.enrolment
        everybody = range(self.plant.size)
        while not all(map(boards.connected, everybody)):
            for board in everybody:
                boards.wait_for(board)
        enrolment.begun = True
        self.plant.run_id = enrolment.run_id
        for board in everybody:
            boards.admit(board)

    def _conclude(self, outcome: Outcome) -> None:
        """Tell everybody that the run is over, hear their last words, and close the recording."""
        boards = self.boards
        self.loop.finish()
        boards.console.say(f"{outcome.tick} {outcome.wall_s:.6f}")
        try:
            hurried = outcome.ending == STOPPED
            boards.say_goodbye(outcome.ending, HURRIED_S if hurried else FAREWELL_S)
        finally:
            if boards.recorder is not None:
                boards.recorder.close(outcome, boards.network.reports())


def assemble(
    network: PlantNetwork, scenario: Scenario, options: PlantOptions, writer: SpoolWriter | None
) -> PlantRuntime:
    """Put together the process that a scenario and the command line ask for."""
    config = plant_config(scenario)
    enrolment = Enrolment(rig=network.rig, joints=scenario.joints, digest=scenario.digest)
    plant = Plant(config, run_id=enrolment.run_id)
    recorder = None if writer is None else Recorder(writer, enrolment)
    console = Console(launcher=options.progress)
    pace = options.pace or scenario.run.pace
    if config.cadence is None:
        lockstep = Lockstep(plant)
        boards = BoardProcesses(network, enrolment, lockstep, console, recorder)
        paced = None if pace is None else Pace(tick_s=config.run.tick_s, pace=pace)
        patience_s = options.patience_s
        loop = PlantLockstepLoop(lockstep, boards, patience_s=patience_s, pace=paced)
        return PlantRuntime(boards, loop)
    running = FreeRunning(plant)
    boards = BoardProcesses(network, enrolment, running, console, recorder)
    realtime = Pace(tick_s=config.run.tick_s, pace=pace or 1.0)
    return PlantRuntime(boards, PlantRealtimeLoop(running, boards, pace=realtime))
