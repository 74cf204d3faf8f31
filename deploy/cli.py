"""The command line: `decmesh --help` is its guide."""

import sys
import textwrap
from argparse import ArgumentTypeError
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from deploy import live_cli, measure_cli, recording_cli, report_cli, study_cli
from deploy import run as runs
from deploy.failure import FailedError
from deploy.processes import SPOOL, RunFailedError, Watch
from deploy.progress import ticks_shown
from deploy.scenario import available, load
from deploy.terminal import JsonOption, OutOption, SetOption, err, out, print_files, print_json
from protocol.durations import duration_s
from protocol.exit_codes import ExitCode
from protocol.process import StoppedError, stop_on_signals
from protocol.scenario import ResolvedScenario, ScenarioError, canonical

if TYPE_CHECKING:
    from deploy.results import Concluded

RUN, SCENARIOS, MEASURE, LIVE = "Run", "Scenarios", "Measure", "On a running robot"
GUIDE = """\
Robot joints that decide for themselves. Each is a board, a process of its own; the boards elect,
over Zenoh, which of them may move, while a plant process integrates the body in lockstep. The same
scenario and seed give the same motion, to the bit.

\b
Three things to begin with:
  [bold]decmesh doctor[/bold]        is this machine fit for it, and if not, what to do
  [bold]decmesh paper[/bold]         the paper's experiment, its Table II beside ours
  [bold]decmesh run blackout[/bold]  a cable is cut while the robot rises;
                        how it is, from another terminal: [bold]decmesh status[/bold]
"""

app = typer.Typer(
    name="decmesh",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help=GUIDE,
    epilog="Every command explains itself, with an example: decmesh run --help",
)
app.add_typer(study_cli.app, name="study", rich_help_panel=MEASURE)
app.add_typer(measure_cli.app, name="measure", rich_help_panel=MEASURE)
SCENARIO_COLUMNS = 80
RECOVER = "decmesh recover {} makes run.mcap of what was recorded"


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
SeedOption = Annotated[int | None, typer.Option(help="Seed of everything random (run.seed).")]
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


def main() -> NoReturn:
    """Run the command line; every way out is an exit code and at most one line per complaint."""
    try:
        stop_on_signals()
        code: int = app(prog_name="decmesh", standalone_mode=False) or ExitCode.OK
    except typer.TyperException as error:
        code = ExitCode.BAD_INPUT
        _explain(error)
    except ScenarioError as error:
        code = ExitCode.BAD_INPUT
        print(error, file=sys.stderr)
    except FailedError as error:
        code = error.code
        print(error, file=sys.stderr)
    except StoppedError:
        code = ExitCode.STOPPED
        print("stopped", file=sys.stderr)
    sys.exit(code)


@app.command(rich_help_panel=RUN)
def paper(
    twin: TwinOption = False,
    settings: SetOption = None,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
) -> None:
    """The paper's experiment: Table II beside ours, and figures.

    With both controllers: the original, where all boards move, and the
    distributed, where they elect the one that moves.

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

    original, distributed = (
        _conclude(part, code, twin=twin) for part, code in zip(parts, codes, strict=True)
    )
    files = results.paper_figures(original.trajectory, distributed.trajectory, folder)
    summaries = {"original": original.summary, "distributed": distributed.summary}
    if as_json:
        print_json({**summaries, "files": files})
    else:
        out.print(results.table(list(summaries.values())))
        print_files(files)
    raise typer.Exit(max(codes))


@app.command(rich_help_panel=RUN)
def run(
    scenario: ScenarioArgument,
    twin: TwinOption = False,
    seed: SeedOption = None,
    settings: SetOption = None,
    out_folder: OutOption = None,
    as_json: JsonOption = False,
    patience: PatienceOption = None,
) -> None:
    """One scenario, in processes over Zenoh or as a twin.

    A plant and a board for each joint, in lockstep. What came out is in summary.json.

    Example: decmesh run paper --set run.duration_s=2 --out short
    """
    overrides = [*(settings or []), *([] if seed is None else [f"run.seed={seed}"])]
    resolved = load(scenario, overrides)
    name: str = resolved.values["name"]
    folder = runs.new_folder(out_folder, name)
    options = [] if patience is None else ["--patience", patience]
    code = _run(resolved, folder, twin=twin, label=name, plant_options=options)
    concluded = _conclude(folder, code, twin=twin)
    if as_json:
        print_json(concluded.summary)
    else:
        from deploy import results  # noqa: PLC0415 - as above

        out.print(results.table([concluded.summary]))
        print_files(concluded.files)
    raise typer.Exit(code)


@app.command(rich_help_panel=RUN)
def doctor(as_json: JsonOption = False) -> None:
    """Whether this machine is fit for it, and if not, what to do.

    Looks at Python, packages, cores, memory, network, ports, folders, the
    clock, and what other runs may have left over.

    Example: decmesh doctor
    """
    from deploy import doctor as doctors  # noqa: PLC0415 - as above

    checks = doctors.examine()
    if as_json:
        print_json({"fit": doctors.fit(checks), "checks": checks})
    else:
        out.print(doctors.report(checks), highlight=False)
    raise typer.Exit(ExitCode.OK if doctors.fit(checks) else ExitCode.UNFIT)


@app.command(rich_help_panel=SCENARIOS)
def scenarios(as_json: JsonOption = False) -> None:
    """Which scenarios there are, and what each shows.

    Example: decmesh scenarios
    """
    shown = {name: load(name).values["description"] for name in available()}
    if as_json:
        print_json(shown)
        return
    for name, description in shown.items():
        line = f"{name:14} {description}"
        print(
            textwrap.fill(
                line, SCENARIO_COLUMNS, subsequent_indent=" " * 15, break_on_hyphens=False
            )
        )


@app.command(rich_help_panel=SCENARIOS)
def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    resolved: Annotated[bool, typer.Option("--resolved", help="Print every value.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Every mistake of a scenario at once, each with its key.

    Example: decmesh check my_robot.toml
    """
    try:
        found = load(scenario, settings or [])
    except ScenarioError as error:
        if not as_json:
            raise
        print_json({"scenario": scenario, "fine": False, "mistakes": str(error).splitlines()})
        raise typer.Exit(ExitCode.BAD_INPUT) from error
    if resolved:
        print(canonical(found.values).decode())
    elif as_json:
        about = {"boards": found.joints, "digest": found.digest.hex()}
        print_json({"scenario": scenario, "fine": True, **about, "mistakes": []})
    else:
        joints = ", ".join(found.joints)
        out.print(f"{scenario}: fine; boards {joints}; digest {found.digest.hex()[:12]}")


for recording_command in (*recording_cli.ALL, report_cli.report):
    app.command(rich_help_panel="Recordings")(recording_command)
for live_command in live_cli.ALL:
    app.command(
        rich_help_panel=LIVE,
        context_settings={"ignore_unknown_options": True},  # A push of -20N is no option.
    )(live_command)


def _explain(error: Any) -> None:
    """Say in one line what is wrong with what was typed, and where to read on."""
    context = getattr(error, "ctx", None)
    command = "decmesh" if context is None else context.command_path
    line = error.format_message()
    if line:
        print(f"{command}: {line.rstrip('.')}; see {command} --help", file=sys.stderr)


def _run(
    scenario: ResolvedScenario,
    folder: Path,
    *,
    twin: bool,
    label: str,
    plant_options: Sequence[str] = (),
) -> int:
    """Run with a progress bar; return the exit code of a run that came to an end of its own."""
    with ticks_shown(err, label, scenario.values) as on_tick:
        watch = Watch(on_tick, _tell)
        with _keeping(folder):
            return runs.run(scenario, folder, twin=twin, watch=watch, plant_options=plant_options)


def _conclude(folder: Path, code: int, *, twin: bool) -> "Concluded":
    """Sum up a run that ended with a code, and make its `run.mcap`.

    That this file cannot be made is worth a line, and no more.
    """
    from deploy import results  # noqa: PLC0415 - as above

    try:
        concluded = results.conclude(folder, "twin" if twin else "processes")
    except OSError as error:
        line = f"cannot write to {folder}: {error.strerror}; {RECOVER.format(folder)}"
        raise RunFailedError(ExitCode.NO_OUTPUT, line) from error
    if concluded is None:
        ended = code in (ExitCode.OK, ExitCode.FELL)  # Else nobody was left to say how.
        line = f"the recording does not say how the run ended; {RECOVER.format(folder)}"
        raise RunFailedError(ExitCode.NO_OUTPUT if ended else ExitCode.PEER_LOST, line)
    try:
        with _keeping(folder), ticks_shown(err, "run.mcap", concluded.spool.scenario) as on_tick:
            return results.keep(concluded, folder, on_tick)
    except OSError as error:
        _tell(f"cannot write run.mcap: {error.strerror}; {RECOVER.format(folder)}")
    return concluded


@contextmanager
def _keeping(folder: Path) -> Iterator[None]:
    """Say what can be made of a run that is stopped in the middle."""
    try:
        yield
    except StoppedError:
        if (folder / SPOOL).exists():
            _tell(RECOVER.format(folder))
        raise


def _tell(line: str) -> None:
    err.print(line, highlight=False, soft_wrap=True)
