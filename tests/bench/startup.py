"""How long things take that happen once: starting, plugging in, dying; and what memory is held."""

import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from deploy.launch.terminal_session import Terminal
from deploy.scenario_file.load import load
from protocol.wire.wiring import rig_of
from tests.bench.children import ChildFailedError
from tests.bench.hanging import hanging
from tests.bench.ours import Rig, rig
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

BARE, BOARD = "Python, nothing imported", "Python, a board imported"
PATIENCE_S = 20.0
LOOK_EVERY_S = 0.0005
JOINT = "joint_1"


def group(_settings: Settings) -> Group:
    """Seconds from a start to what the start is for."""
    return Group(
        "start",
        "start and end of processes, s",
        [
            Contender(BARE, partial(imported, "sys")),
            Contender(BOARD, partial(imported, "module_agent.process.serving")),
            Contender("a board: started to enrolled", enrolled),
            Contender("plant and 3 boards: started to tick 0", released),
            Contender("decmesh run of one tick, started to result", one_tick),
            Contender("a board: plugged in to first accepted torque", plugged),
        ],
        [Ratio("a board imported, of nothing imported", BOARD, BARE, "seconds")],
    )


def memory(_settings: Settings) -> Group:
    """What the processes of a running robot hold."""
    return Group(
        "memory",
        "memory of a process, MB",
        [
            Contender("the plant", partial(held, "plant")),
            Contender("a board", partial(held, JOINT)),
        ],
    )


def imported(module: str) -> Figures:
    """A whole process that does nothing but import."""
    started = time.perf_counter()
    subprocess.run([sys.executable, "-c", f"import {module}"], check=True)
    return {"seconds": time.perf_counter() - started}


def enrolled() -> Figures:
    """From the start of a board to the line of a waiting plant that it is there."""
    with rig(load("paper")) as started:
        started.start_plant()
        _wait_for_line(started, "ankle, knee, hip")
        began = time.perf_counter()
        started.start_board("hip")
        _wait_for_line(started, "waiting for ankle, knee\n")
        return {"seconds": time.perf_counter() - began}


def released() -> Figures:
    """From the start of all processes at once to the release of the body."""
    with rig(hanging(3)) as started:
        began = time.perf_counter()
        since_release_s = _start(started)
        return {"seconds": time.perf_counter() - began - since_release_s}


def one_tick() -> Figures:
    """What a user waits for at least."""
    with TemporaryDirectory(prefix="decmesh-bench-") as folder:
        command = [sys.executable, "-m", "deploy", "run", "paper", "--out", f"{folder}/run"]
        began = time.perf_counter()
        subprocess.run([*command, "--set", "run.duration_s=0.001"], check=True, capture_output=True)
        return {"seconds": time.perf_counter() - began}


def plugged() -> Figures:
    """A board is killed and another one started while the others go on."""
    with rig(hanging(3)) as started:
        _start(started)
        began = time.perf_counter()
        started.children.processes[JOINT].kill()
        _wait_for_line(started, f"{JOINT} died")
        notice_s = time.perf_counter() - began
        with Terminal(rig_of(started.scenario)) as terminal:
            terminal.status()
            began = time.perf_counter()
            started.start_board(JOINT, "another")
            while terminal.status()["boards"][1]["state"] in {"absent", "joining"}:
                if time.perf_counter() - began > PATIENCE_S:
                    raise ChildFailedError(started.children.last_line("another"))
        return {"seconds": time.perf_counter() - began, "notice_s": notice_s}


def held(name: str) -> Figures:
    """Memory of a process in the middle of a run (Linux)."""
    with rig(hanging(3)) as started:
        _start(started)
        time.sleep(0.5)
        pid = started.children.processes[name].pid
        kilobytes: dict[str, int] = {}
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
            key, value = line.split()[:2]
            kilobytes[key.rstrip(":")] = int(value)
        own = kilobytes["Private_Clean"] + kilobytes["Private_Dirty"]
        return {"resident_mb": kilobytes["Rss"] / 1024.0, "own_mb": own / 1024.0}


def _start(started: Rig) -> float:
    """Start everybody, wait until the run is under way, and tell for how many seconds it is."""
    started.start_plant("--progress")
    for joint in started.scenario.joints:
        started.start_board(joint)
    _tick, since_release_s = _wait_for_line(started, "0.1").split()
    return float(since_release_s)


def _wait_for_line(started: Rig, text: str) -> str:
    """Wait until the plant says something; return its last line."""
    log, deadline = started.place.folder / "plant.log", time.perf_counter() + PATIENCE_S
    while text not in log.read_text():
        if time.perf_counter() > deadline:
            raise ChildFailedError(f"the plant did not say {text!r}: {log.read_text()!r}")
        time.sleep(LOOK_EVERY_S)
    return started.children.last_line("plant")
