"""How decmesh speaks to who runs it: results on standard output, the way there on standard error.

Rule 1: what is piped has no colours, no bars and no line that a program would trip over.
Rule 2: with `--json`, standard output holds one JSON value and nothing else.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

from deploy.failure import FailedError
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import Scenario

out, err = Console(), Console(stderr=True)
WIDTH_MAX = 500

SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value, e.g. run.duration_s=2."),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="Folder for the results; default: a new one in runs/.")
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")
]


def print_json(value: Any) -> None:
    """Print one JSON value; what is no number is null, tuples with names are objects."""
    print(json.dumps(_plain(value), indent=2, allow_nan=False, ensure_ascii=False))


def print_table(table: Table) -> None:
    """Print a table in its own width, also where that is more than a terminal has."""
    natural = Console(width=WIDTH_MAX).measure(table).maximum
    Console(width=max(out.width, natural)).print(table, soft_wrap=True)


def print_files(paths: Iterable[Path]) -> None:
    """Print where results are, a line each."""
    for path in paths:
        print_dim(str(path))


def print_dim(line: str) -> None:
    """Print a line of lesser weight, to the letter: brackets are no markup."""
    out.print(line, style="dim", markup=False, highlight=False, soft_wrap=True)


def say(line: str) -> None:
    """Say a line on the way to a result."""
    err.print(line, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def writing(place: Path) -> Iterator[None]:
    """Make one line of it when what a user named cannot be written."""
    try:
        yield
    except OSError as error:
        line = f"cannot write to {place}: {error.strerror}; choose another --out"
        raise FailedError(ExitCode.NO_OUTPUT, line) from error


def tell(
    facts: dict[str, Any],
    shown: Iterable[Table | str],
    write: Callable[[], list[Path]],
    *,
    as_json: bool,
) -> None:
    """Write files, and print what came out: the facts for programs, or what is shown to people.

    Where the files cannot be written the rest is not lost: it is printed, and then `FailedError`
    is raised.
    """
    files, trouble = [], None
    try:
        files = write()
    except OSError as error:
        trouble = error
    if as_json:
        print_json({**facts, "files": files})
    else:
        for one in shown:
            if isinstance(one, Table):
                print_table(one)
            else:
                print_dim(one)
        print_files(files)
    if trouble is not None:
        line = f"cannot write {trouble.filename or 'the files'}: {trouble.strerror}"
        raise FailedError(ExitCode.NO_OUTPUT, line) from trouble


@contextmanager
def progress(
    label: str, total: float, note: str = "left, Ctrl-C keeps what is done"
) -> Iterator[Callable[[float], None]]:
    """Show a bar with the time left while work goes on; yields what to call with work done."""
    if not err.is_terminal:
        yield lambda _done: None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        TextColumn(note, style="dim"),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task(label, total=total)
        yield lambda done: bar.advance(task, done)


@contextmanager
def ticks_shown(label: str, scenario: Scenario) -> Iterator[Callable[[int], None]]:
    """Show the ticks of a scenario as they go by; yields what to call with the newest."""
    with progress(label, scenario.run.ticks, "left") as advance:
        shown = 0

        def on_tick(tick: int) -> None:
            nonlocal shown
            advance(tick - shown)
            shown = tick

        yield on_tick


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return str(value) if isinstance(value, Path) else value
