"""Is this machine fit for decmesh? `decmesh doctor` looks, and says what to do where it is not."""

import platform
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Group
from rich.table import Table
from rich.text import Text

from deploy.commands import doctor_checks as look
from deploy.commands.doctor_checks import Check
from deploy.launch import machine, rigs
from deploy.launch.folders import RUNS
from deploy.scenario_file.load import load

SCENARIO = "paper"
STYLES = {"ok": "green", "mind": "yellow", "wrong": "bold red"}
ENDS = {
    "ok": "All is well. Go on with: decmesh paper",
    "mind": "Fit, with what is marked to bear in mind. Go on with: decmesh paper",
    "wrong": "Not fit. What to do is said above.",
}


def examine() -> list[Check]:
    """Look at everything."""
    wanted = look.needs()
    return [
        look.python(wanted.python, platform.python_version()),
        *(look.package(name, least) for name, least in wanted.packages.items()),
        look.own_packages(),
        look.control_loop(),
        look.cores(machine.cores()),
        look.memory(machine.free_memory_mb()),
        look.loopback(),
        look.clock(),
        look.folder("run folder", RUNS, "go to a folder that is yours, or choose another: --out"),
        *_network(),
    ]


def fit(checks: Sequence[Check]) -> bool:
    """Whether nothing was found that keeps a robot from running."""
    return all(check.verdict != "wrong" for check in checks)


def report(checks: Sequence[Check]) -> Group:
    """Write down what was found, what to do about it, and what follows."""
    table = Table.grid(padding=(0, 2, 0, 0))
    for check in checks:
        style = STYLES[check.verdict]
        table.add_row(Text(check.verdict, style), Text(check.about), Text(check.found))
        if check.do:
            table.add_row("", "", Text(f"do: {check.do}", style))
    verdicts = {check.verdict for check in checks}
    worst = next(verdict for verdict in ("wrong", "mind", "ok") if verdict in verdicts)
    return Group(table, Text(), Text(ENDS[worst], STYLES[worst]))


def _network() -> Iterator[Check]:
    """What a robot would be placed with: its folder, ports and a connection."""
    try:
        yield look.folder("rig folder", rigs.folder(), "set XDG_RUNTIME_DIR to a folder of yours")
        yield look.rig_files()
        yield look.processes()
        scenario = load(SCENARIO)
        rig = scenario.rig
        with rigs.claim(scenario, Path()) as placed:
            free = placed.rig.base_port
            yield look.ports(rig.base_port, free, len(scenario.joints) + 1)
            yield look.zenoh(rig.host, free)
    except rigs.NoPortsError as error:
        yield Check("ports", "wrong", str(error), "end other programs that listen there")
    except OSError as error:
        do = "set XDG_RUNTIME_DIR to a folder of yours"
        yield Check("rig folder", "wrong", f"{error.filename}: {error.strerror}", do)
