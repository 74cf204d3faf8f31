"""Commands on scenarios: which there are, and what is wrong with one."""

import textwrap
from typing import Annotated

import typer

from deploy.commands.terminal import JsonOption, SetOption, out, print_json
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import ScenarioError, canonical

SCENARIO_COLUMNS = 80

ScenarioArgument = Annotated[
    str, typer.Argument(help="A scenario by name (see `decmesh scenarios`), or a TOML file.")
]


def scenarios(as_json: JsonOption = False) -> None:
    """List the scenarios, and what each shows.

    Example: decmesh scenarios
    """
    from deploy.scenario_file.load import available, load  # noqa: PLC0415 - pydantic, needed only now

    shown = {name: load(name).description for name in available()}
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


def check(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    resolved: Annotated[bool, typer.Option("--resolved", help="Print every value.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Name every mistake of a scenario, each with its key.

    Example: decmesh check my_robot.toml
    """
    from deploy.scenario_file.load import load  # noqa: PLC0415 - as above

    try:
        found = load(scenario, settings or [])
    except ScenarioError as error:
        if not as_json:
            raise
        print_json({"scenario": scenario, "fine": False, "mistakes": str(error).splitlines()})
        raise typer.Exit(ExitCode.BAD_INPUT) from error
    if resolved:
        print(canonical(found).decode())
    elif as_json:
        about = {"boards": found.joints, "digest": found.digest.hex()}
        print_json({"scenario": scenario, "fine": True, **about, "mistakes": []})
    else:
        joints = ", ".join(found.joints)
        line = f"{scenario}: fine; boards {joints}; digest {found.digest.hex()[:12]}"
        out.print(line, markup=False)


ALL = (scenarios, check)
