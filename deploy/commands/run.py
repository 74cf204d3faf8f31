"""Commands that run robots: `decmesh paper`, `decmesh run`."""

from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from deploy.commands.scenarios import ScenarioArgument
from deploy.commands.terminal import (
    JsonOption,
    OutOption,
    SetOption,
    out,
    print_files,
    print_json,
    say,
    ticks_shown,
)
from deploy.failure import FailedError
from deploy.launch.folders import new_folder
from deploy.launch.processes import SPOOL, LaunchWatch, RunFailedError
from protocol.process.durations import PACE_MAX, PACE_MIN, duration_s
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError, stop_on_signals
from protocol.robot.scenario import Scenario

if TYPE_CHECKING:
    from deploy.outcome.results import FinishedRun

RECOVER = "decmesh recover {} makes run.mcap of what was recorded, also in another --out"


def _checked_time(text: str | None) -> str | None:
    try:
        if text is not None:
            duration_s(text)
    except ArgumentTypeError as error:
        raise typer.BadParameter(str(error)) from error
    return text


SeedOption = Annotated[int | None, typer.Option(help="Seed of everything random (run.seed).")]
TwinOption = Annotated[
    bool, typer.Option("--twin", help="In one process instead; the trajectory is bit-identical.")
]
PatienceOption = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        callback=_checked_time,
        help="Go on without a board that is silent for so long, e.g. 200ms; default: wait.",
    ),
]
RealtimeOption = Annotated[
    bool,
    typer.Option("--realtime", help="By the wall clock: nobody waits; not repeatable."),
]
PaceOption = Annotated[
    float | None,
    typer.Option(
        min=PACE_MIN,
        max=PACE_MAX,
        metavar="FACTOR",
        help="At most so many simulated seconds per second, e.g. 1 or 0.25.",
    ),
]


def paper(
    twin: TwinOption = False,
    settings: SetOption = None,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run the paper's experiment: its Table II beside ours, and figures.

    With both controllers: the original, where all boards move, and the
    distributed, where they elect the one that moves.

    Example: decmesh paper
    """
    from deploy.scenario_file.load import load  # noqa: PLC0415 - pydantic, needed only now

    scenarios = [
        load("paper", [*(settings or []), f"election.enabled={elects}"])
        for elects in ("false", "true")
    ]
    folder = new_folder(out_folder, "paper")
    parts = [new_folder(folder / name, name) for name in ("original", "distributed")]
    original, distributed = (
        _run(scenario, part, twin=twin, label=part.name)
        for scenario, part in zip(scenarios, parts, strict=True)
    )
    from deploy.outcome import results  # noqa: PLC0415 - numpy and matplotlib, needed only now

    first, second = original.concluded, distributed.concluded
    files = results.paper_figures(first.trajectory, second.trajectory, folder)
    summaries = {"original": first.summary, "distributed": second.summary}
    if as_json:
        print_json({**summaries, "files": files})
    else:
        out.print(results.table(list(summaries.values())))
        print_files(files)
    raise typer.Exit(max(original.code, distributed.code))


def run(
    scenario: ScenarioArgument,
    twin: TwinOption = False,
    seed: SeedOption = None,
    settings: SetOption = None,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
    patience: PatienceOption = None,
    realtime: RealtimeOption = False,
    pace: PaceOption = None,
) -> None:
    """Run one scenario, in processes over Zenoh or in one process.

    A plant and a board for each joint, in lockstep unless the scenario says
    otherwise. The result is in summary.json.

    Example: decmesh run paper --set run.duration_s=2 --out short
    """
    from deploy.scenario_file.load import load  # noqa: PLC0415 - as above

    overrides = [*(settings or []), *([] if seed is None else [f"run.seed={seed}"])]
    overrides += ["run.mode=realtime"] if realtime else []
    resolved = load(scenario, overrides)
    _check_clock(in_realtime=resolved.realtime is not None, twin=twin, pace=pace)
    name = resolved.name
    folder = new_folder(out_folder, name)
    options = [] if patience is None else ["--patience", patience]
    options += [] if pace is None else ["--pace", str(pace)]
    ran = _run(resolved, folder, twin=twin, label=name, plant_options=options)
    if as_json:
        print_json(ran.concluded.summary)
    else:
        from deploy.outcome import results  # noqa: PLC0415 - as above

        out.print(results.table([ran.concluded.summary]))
        print_files(ran.files)
    raise typer.Exit(ran.code)


class _Ran(NamedTuple):
    """A run that is over, and what was made of it."""

    code: int
    concluded: "FinishedRun"
    files: list[Path]


def _check_clock(*, in_realtime: bool, twin: bool, pace: float | None) -> None:
    if twin and (in_realtime or pace is not None):
        raise typer.BadParameter("the twin has no wall clock: neither realtime nor --pace")
    if in_realtime and pace is not None:
        raise typer.BadParameter("realtime goes at the pace of the wall clock; leave --pace out")


def _run(
    scenario: Scenario,
    folder: Path,
    *,
    twin: bool,
    label: str,
    plant_options: Sequence[str] = (),
) -> _Ran:
    """Run with a progress bar, and make `summary.json` and `run.mcap` of what was recorded.

    Also of a run that is stopped; then raises `StoppedError`.
    """
    from deploy.launch.run import run as run_scenario  # noqa: PLC0415 - plant and boards, needed only now

    with ticks_shown(label, scenario) as on_tick:
        watch = LaunchWatch(on_tick, say)
        try:
            code = run_scenario(
                scenario, folder, twin=twin, watch=watch, plant_options=plant_options
            )
        except StoppedError:
            code = ExitCode.STOPPED
            stop_on_signals()  # What is made of it can be stopped as well.
    concluded, files = _conclude(folder, twin=twin)
    if code == ExitCode.STOPPED:
        for path in files:
            say(f"{path}: the run until then")
        raise StoppedError
    code = code if code >= 0 else ExitCode.PEER_LOST
    ended = code in (ExitCode.OK, ExitCode.FELL)
    if concluded is None:
        line = "nothing of the run was recorded"
        raise RunFailedError(ExitCode.NO_OUTPUT if ended else code, line)
    if ended and not (files and concluded.spool.complete):
        code = ExitCode.NO_OUTPUT
    if not ended and not concluded.spool.complete:
        say(f"the plant died; recorded are {concluded.trajectory.ticks:,} ticks of the run")
    return _Ran(code, concluded, files)


def _conclude(folder: Path, *, twin: bool) -> "tuple[FinishedRun | None, list[Path]]":
    """Sum up a run, and write its files. That one cannot be written is worth a line, and no more.

    None: there is nothing to sum up.
    """
    concluded: FinishedRun | None = None
    files: list[Path] = []
    try:
        from deploy.outcome import results  # noqa: PLC0415 - numpy and matplotlib, needed only now

        concluded = results.conclude(folder, "twin" if twin else "processes")
        if concluded is not None:
            with ticks_shown("run.mcap", concluded.spool.scenario) as on_tick:
                files.extend(results.write(concluded, folder, on_tick))
    except OSError as error:
        say(f"cannot write to {folder}: {error.strerror}; {RECOVER.format(folder)}")
    except FailedError as error:
        say(f"no run.mcap: {error}; {folder / SPOOL} stays")
    except StoppedError:
        if (folder / SPOOL).exists():
            say(RECOVER.format(folder))
        raise
    return concluded, files


ALL = (paper, run)
