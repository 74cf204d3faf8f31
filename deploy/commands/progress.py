"""A bar that shows how far a run is, or what is made of it; nothing where there is no terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


@contextmanager
def ticks_shown(
    console: Console, label: str, scenario: dict[str, Any]
) -> Iterator[Callable[[int], None]]:
    """Show ticks of a scenario as they go by; whoever plays them calls what this gives."""
    tick_s, ticks = scenario["run"]["tick_s"], scenario["run"]["ticks"]
    columns = (
        TextColumn("{task.description:12}"),
        BarColumn(),
        TextColumn("{task.fields[done_s]:5.1f} s of {task.fields[whole_s]:g} s"),
        TimeRemainingColumn(),
    )
    if not console.is_terminal:
        yield lambda _tick: None
        return
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(label, total=ticks, done_s=0.0, whole_s=ticks * tick_s)

        def on_tick(tick: int) -> None:
            progress.update(task, completed=tick, done_s=tick * tick_s)

        yield on_tick
