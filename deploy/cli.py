"""The command line: `decmesh --help` is its guide."""

import json
import sys
import textwrap
from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from deploy import live_cli
from deploy import run as runs
from deploy.failure import FailedError
from deploy.processes import RunFailedError, Watch
from deploy.scenario import available, load
from protocol.durations import duration_s
from protocol.exit_codes import ExitCode
from protocol.process import StoppedError, stop_on_signals
from protocol.scenario import ResolvedScenario, ScenarioError, canonical

if TYPE_CHECKING:
    from deploy.summary import Summary
    from deploy.trajectory import Trajectory

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Robot joints that decide for themselves: separate board processes that elect, over"
    " Zenoh, which of them may move, while a plant process integrates the body in lockstep.",
    epilog="Start with: decmesh paper",
)
study = typer.Typer(no_args_is_help=True, help="Run many twins; sum them up as table and figure.")
app.add_typer(study, name="study")
out, err = Console(), Console(stderr=True)
SCENARIO_COLUMNS = 80


def _checked_time(text: str | None) -> str | None:
    try:
        if text is not None:
            duration_s(text)
    except ArgumentTypeError as error:
        raise typer.BadParameter(str(error)) from error
    return text


ScenarioArgument = Annotated[
    str, typer.Argument(help="A scenario by name (see `decmesh scenarios`), or a TOML file.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. run.duration_s=2."),
]
SeedOption = Annotated[int | None, typer.Option(help="Seed of everything random (run.seed).")]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; default: a new one in runs/.")
]
TwinOption = Annotated[
    bool, typer.Option("--twin", help="In one process instead: the same trajectory to the bit.")
]
PatienceOption = Annotated[
    str | None,
    typer.Option(
        metavar="TIME",
        callback=_checked_time,
        help="Go on without a board that is silent for so long, e.g. 200ms; default: never.",
    ),
]
RealtimeOption = Annotated[
    bool, typer.Option("--realtime", help="By the wall clock, waiting for nobody: not repeatable.")
]
PaceOption = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        max=1000.0,
        metavar="FACTOR",
        help="Go no faster than so many seconds of the body in one of the wall, e.g. 1 or 0.25.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]


def main() -> NoReturn:
    """Run the command line; every way out is an exit code and at most one line per complaint."""
    try:
        stop_on_signals()
        app()
    except ScenarioError as error:
        code: int = ExitCode.BAD_INPUT
        print(error, file=sys.stderr)
    except FailedError as error:
        code = error.code
        print(error, file=sys.stderr)
    except StoppedError:
        code = ExitCode.STOPPED
        print("stopped", file=sys.stderr)
    sys.exit(code)


@app.command()
def paper(
    twin: TwinOption = False,
    settings: SetOption = None,
    out_folder: OutOption = None,
) -> None:
    """Run the paper's experiment, original and distributed, and print its Table II beside ours.

    Example: decmesh paper
    """
    scenarios = [
        load("paper", [*(settings or []), f"election.enabled={elects}"])
        for elects in ("false", "true")
    ]
    folder = runs.new_folder(out_folder, "paper")
    parts = [runs.new_folder(folder / name, name) for name in ("original", "distributed")]
    codes = [
        _run(scenario, part, twin=twin, label=part.name)
        for scenario, part in zip(scenarios, parts, strict=True)
    ]
    from deploy import results  # noqa: PLC0415 - numpy and matplotlib, needed only now

    original, distributed = (_conclude(part, twin=twin) for part in parts)
    out.print(results.table([original[1], distributed[1]]))
    for path in results.paper_figures(original[0], distributed[0], folder):
        out.print(f"[dim]{path}[/dim]", soft_wrap=True, highlight=False)
    raise typer.Exit(max(codes))


@app.command()
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
    """Run one scenario: a plant and its boards as processes over Zenoh, in lockstep.

    Example: decmesh run paper --set run.duration_s=2 --out short
    """
    overrides = [*(settings or []), *([] if seed is None else [f"run.seed={seed}"])]
    overrides += ["run.mode=realtime"] if realtime else []
    resolved = load(scenario, overrides)
    name: str = resolved.values["name"]
    by_wall = "realtime" in resolved.values
    if twin and (by_wall or pace is not None):
        raise typer.BadParameter("the twin has no wall clock: neither --realtime nor --pace")
    if by_wall and pace is not None:
        raise typer.BadParameter("realtime goes at the pace of the wall clock; leave --pace out")
    folder = runs.new_folder(out_folder, name)
    options = [] if patience is None else ["--patience", patience]
    options += [] if pace is None else ["--pace", str(pace)]
    code = _run(resolved, folder, twin=twin, label=name, plant_options=options)
    _trajectory, summary = _conclude(folder, twin=twin)
    if as_json:
        print(json.dumps(summary, indent=2))
    else:
        from deploy import results  # noqa: PLC0415 - as above

        out.print(results.table([summary]))
        out.print(f"[dim]{folder / runs.SUMMARY}[/dim]", soft_wrap=True, highlight=False)
    raise typer.Exit(code)


@app.command()
def scenarios() -> None:
    """List the scenarios that come with decmesh, each with what it shows.

    Example: decmesh scenarios
    """
    for name in available():
        line = f"{name:14} {load(name).values['description']}"
        print(
            textwrap.fill(
                line, SCENARIO_COLUMNS, subsequent_indent=" " * 15, break_on_hyphens=False
            )
        )


@app.command()
def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    resolved: Annotated[bool, typer.Option("--resolved", help="Print every value.")] = False,
) -> None:
    """Check a scenario: every mistake at once, each with its file and key.

    Example: decmesh check my_robot.toml
    """
    found = load(scenario, settings or [])
    if resolved:
        print(canonical(found.values).decode())
    else:
        joints = ", ".join(found.joints)
        out.print(f"{scenario}: fine; boards {joints}; digest {found.digest.hex()[:12]}")


@study.command("loss")
def study_loss(
    seeds: Annotated[int, typer.Option(min=1, help="Runs of each loss and R.")] = 5,
    duration: Annotated[str, typer.Option(help="Of each run, such as 10s.")] = "10s",
    out_folder: OutOption = None,
) -> None:
    """Lose 0 to 50 % of all frames, with 2 to 8 consensus rounds: agreement and balance.

    Example: decmesh study loss --seeds 2
    """
    from deploy import study as studies  # noqa: PLC0415 - as above
    from deploy import study_figure  # noqa: PLC0415 - as above
    from deploy.study_table import loss_table  # noqa: PLC0415 - as above

    cases = studies.grid(seeds=seeds, duration_s=live_cli.quantity(duration, "time"))
    folder = runs.new_folder(out_folder, "study-loss")
    with Progress(console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task("study loss", total=len(cases))
        results, complete = studies.run_cases(cases, lambda: progress.advance(task))
    rows = list(studies.means(results))
    if rows:
        studies.write_csv(results, folder / studies.CSV)
        out.print(loss_table(rows))
        for path in (folder / studies.CSV, *study_figure.loss_figure(rows, folder / "loss")):
            out.print(f"[dim]{path}[/dim]", soft_wrap=True, highlight=False)
    if not complete:
        err.print(f"{len(results)} of {len(cases)} runs were done")
        raise StoppedError


for live_command in live_cli.ALL:
    app.command(
        rich_help_panel="On a running robot",
        context_settings={"ignore_unknown_options": True},  # A push of -20N is no option.
    )(live_command)


def _run(
    scenario: ResolvedScenario,
    folder: Path,
    *,
    twin: bool,
    label: str,
    plant_options: Sequence[str] = (),
) -> int:
    """Run with a progress bar; return the exit code of a run that came to an end of its own."""
    tick_s, ticks = scenario.values["run"]["tick_s"], scenario.values["run"]["ticks"]
    columns = (
        TextColumn("{task.description:12}"),
        BarColumn(),
        TextColumn("{task.fields[done_s]:5.1f} s of {task.fields[whole_s]:g} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as progress:
        task = progress.add_task(label, total=ticks, done_s=0.0, whole_s=ticks * tick_s)

        def on_tick(tick: int) -> None:
            progress.update(task, completed=tick, done_s=tick * tick_s)

        watch = Watch(on_tick, lambda line: err.print(line, highlight=False, soft_wrap=True))
        return runs.run(scenario, folder, twin=twin, watch=watch, plant_options=plant_options)


def _conclude(folder: Path, *, twin: bool) -> "tuple[Trajectory, Summary]":
    from deploy import results  # noqa: PLC0415 - as above

    concluded = results.conclude(folder, "twin" if twin else "processes")
    if concluded is None:
        line = f"the run did not say how it ended; what was recorded until then is in {folder}"
        raise RunFailedError(ExitCode.PEER_LOST, line)
    return concluded
