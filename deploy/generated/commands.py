"""Commands and their options, from the command line itself."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import typer

from deploy.cli import app
from deploy.generated.markdown import table


class _Command(NamedTuple):
    """A command as it is typed, in which group of `decmesh --help`."""

    typed: str
    group: str
    about: Any
    """Typer's own description of it."""

    @property
    def sentence(self) -> str:
        """What it does, in a line."""
        first: str = self.about.help.partition("\n\n")[0]
        return " ".join(first.split())


def commands() -> str:
    """Give every command with what it does."""
    rows = [(f"`{command.typed}`", command.sentence) for command in _commands()]
    return table(("command", "what it does"), rows)


def options(group: str) -> str:
    """Give a heading and a table of arguments and options for each command of a group."""
    return "\n\n".join(
        f"### `{command.typed}`\n\n{command.sentence}\n\n{_parameters(command.about)}"
        for command in _commands()
        if command.group == group
    )


def _commands() -> Iterator[_Command]:
    root: Any = typer.main.get_command(app)
    for name, one in root.commands.items():
        inner = getattr(one, "commands", {"": one})
        for below, command in inner.items():
            yield _Command(f"decmesh {name} {below}".strip(), one.rich_help_panel, command)


def _parameters(command: Any) -> str:
    rows = [
        (f"`{_typed(one)}`", one.help, _default(one))
        for one in command.params
        if one.name != "help"
    ]
    return table(("argument or option", "meaning", "default"), rows)


def _typed(parameter: Any) -> str:
    """Give an argument or an option as it is typed."""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name.upper())
    (option,) = parameter.opts
    return option if parameter.is_flag else f"{option} {parameter.metavar or 'VALUE'}"


def _default(parameter: Any) -> str:
    if parameter.required:
        return "required"
    value = parameter.default
    return "" if value in (None, False) else f"`{value}`"
