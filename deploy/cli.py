"""The command line: `decmesh --help` is its guide."""

import sys
from typing import Any, NoReturn

import typer

from deploy.commands import live as live_cli
from deploy.commands import measure as measure_cli
from deploy.commands import recordings as recording_cli
from deploy.commands import report as report_cli
from deploy.commands import run as run_cli
from deploy.commands import scenarios as scenario_cli
from deploy.commands import study as study_cli
from deploy.commands.terminal import JsonOption, out, print_json
from deploy.failure import FailedError
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError, stop_on_signals
from protocol.robot.scenario import ScenarioError

RUN, SCENARIOS, MEASURE, LIVE = "Run", "Scenarios", "Measure", "On a running robot"
GUIDE = """\
Robot joints that decide for themselves. Each has a board, a process of its own. The boards elect,
over Zenoh, which of them may move, while a plant process integrates the body. The same scenario and
seed give the same motion, bit for bit.

\b
Three things to begin with:
  [bold]decmesh doctor[/bold]        can this machine run it, and if not, what to do
  [bold]decmesh paper[/bold]         the paper's experiment, its Table II beside ours
  [bold]decmesh run blackout[/bold]  a cable is cut while the robot rises;
                        look at it from another terminal: [bold]decmesh status[/bold]
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
def doctor(as_json: JsonOption = False) -> None:
    """Check whether this machine can run decmesh; if not, say what to do.

    Looks at Python, packages, cores, memory, network, ports, folders, the
    clock, and what other runs may have left over.

    Example: decmesh doctor
    """
    from deploy.commands import doctor as doctors  # noqa: PLC0415 - it imports the packages that it looks at

    checks = doctors.examine()
    if as_json:
        print_json({"fit": doctors.fit(checks), "checks": checks})
    else:
        out.print(doctors.report(checks), highlight=False)
    raise typer.Exit(ExitCode.OK if doctors.fit(checks) else ExitCode.UNFIT)


for panel, commands in (
    (RUN, run_cli.ALL),
    (SCENARIOS, scenario_cli.ALL),
    ("Recordings", (*recording_cli.ALL, report_cli.report)),
):
    for command in commands:
        app.command(rich_help_panel=panel)(command)
for live_command in live_cli.ALL:
    app.command(
        rich_help_panel=LIVE,
        context_settings={"ignore_unknown_options": True},  # A push of -20N is no option.
    )(live_command)


def _explain(error: Any) -> None:
    """Say in one line what is wrong with what was typed, and where to read on."""
    context = getattr(error, "ctx", None)
    command = "decmesh" if context is None else context.command_path
    line = " ".join(error.format_message().replace("Value error, ", "").split())
    if line:
        print(f"{command}: {line.rstrip('.')}; see {command} --help", file=sys.stderr)
