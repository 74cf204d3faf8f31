"""Results as one table, and a comparison as another."""

from collections.abc import Iterator, Sequence

from rich.table import Table

from tests.bench.compare import Change
from tests.bench.registry import kind_of
from tests.bench.results import GroupResult, Results
from tests.bench.spread import Spread

BESIDE = ("p50_us", "p99_us", "cpu_us")
"""Figures that have a column of their own."""
HEADINGS = ("", "median", "min", "max", "p50 µs", "p99 µs", "CPU µs")
RATIO = "ratio"
"""Stands for a figure where a ratio is shown."""
Row = tuple[str, ...]


def rows(group: GroupResult) -> Iterator[Row]:
    """One row for each contender, one below it for each figure more, then the ratios."""
    for name, entry in group.entries.items():
        main, *others = entry.figures
        beside = [_cell(entry.spread(key).median, key) if key in others else "" for key in BESIDE]
        yield (name, *_cells(entry.spread(main), main), *beside)
        for key in others:
            if key not in BESIDE:
                yield (f"  {kind_of(key).label}", *_cells(entry.spread(key), key), *[""] * 3)
    for name, ratio in group.ratios.items():
        yield (f"  {name}", *_cells(ratio.spread(), RATIO), *[""] * 3)


def result_table(results: Results) -> Table:
    """Everything that was measured."""
    table = Table(*HEADINGS, title="decmesh bench")
    for column in table.columns[1:]:
        column.justify = "right"
    for group in results.groups.values():
        table.add_section()
        table.add_row(f"[bold]{group.title}")
        for row in rows(group):
            table.add_row(*row)
    return table


def markdown(results: Results) -> str:
    """The same as a Markdown table."""
    lines = [HEADINGS, ("---", *["--:"] * (len(HEADINGS) - 1))]
    for group in results.groups.values():
        lines.append((f"**{group.title}**", *[""] * (len(HEADINGS) - 1)))
        lines += ((row[0].strip(), *row[1:]) for row in rows(group))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def footnotes(results: Results) -> Iterator[str]:
    """What has to be said with the table: machine, versions, load, and what is missing."""
    about = results.machine
    versions = ", ".join(f"{name} {found}" for name, found in about["versions"].items())
    fifo = " under SCHED_FIFO" if results.settings.get("fifo") else ""
    yield (
        f"{results.settings['repeats']} repeats, taken in turn{fifo}; {about['cores']} cores of"
        f" {about['processor']}, {about['system']}, Python {about['python']}, {versions},"
        f" control loop {about['control_loop']} unless said otherwise;"
        f" commit {about['commit']}, {about['when']}"
    )
    loads = [load for group in results.groups.values() for load in group.load]
    if loads:
        yield f"load before and after each group: {min(loads):.1f} to {max(loads):.1f}"
    for group in results.groups.values():
        for name, reason in group.missing.items():
            yield f"without {name}: {reason}"


def comparison_table(changes: Sequence[Change]) -> Table:
    """What has changed, and by how much; what has not is left out."""
    table = Table("", "figure", "then", "now", "now/then", "", title="since then")
    for change in changes:
        if change.verdict != "same":
            style = "red" if change.verdict == "worse" else "green"
            ratio = change.name.startswith("ratio: ")
            figure = RATIO if ratio else change.figure
            cells = [_cell(one.median, figure) for one in (change.then, change.now)]
            table.add_row(
                f"{change.group}: {change.name}",
                kind_of(change.figure).label,
                *cells,
                f"{change.factor:.2f}",
                f"[{style}]{change.verdict}",
            )
    return table


def _cells(values: Spread, figure: str) -> list[str]:
    return [_cell(value, figure) for value in values[:3]]


def _cell(value: float, figure: str) -> str:
    decimals = kind_of(figure).decimals
    if value and abs(value) < 0.5 * 10**-decimals:
        return f"{value:.1e}"
    return f"{value:,.{decimals}f}"
