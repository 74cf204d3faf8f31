"""What was measured of consensus, as tables for a terminal: at most 80 columns."""

from collections.abc import Iterable, Iterator, Sequence

from rich import box
from rich.table import Table

from deploy.experiments.consensus.run import NEVER, ConsensusRow
from deploy.experiments.consensus.theory import MeasuredAndExpected, TheoryComparison


def rounds_table(rows: Iterable[ConsensusRow]) -> Table:
    """Rounds to agreement, and how many boards would be enabled after R rounds."""
    table = _table(
        "Rounds until every board knows the maximum",
        (
            *_CASE,
            "p50",
            "p90",
            "p99",
            "max",
            "by d\n%",
            "by R\n%",
            "none\n%",
            "one\n%",
            "more\n%",
        ),
    )
    for above, row in _sections(table, rows):
        table.add_row(
            *_case(row, above),
            *map(_rounds, row.agreement_rounds),
            *(
                f"{100.0 * share:.1f}"
                for share in (
                    row.agreed_in_diameter,
                    row.agreed_in_rounds,
                    row.enabled_0 / row.epochs,
                    row.enabled_1 / row.epochs,
                    row.enabled_2_or_more / row.epochs,
                )
            ),
        )
    return table


def wall_table(rows: Iterable[ConsensusRow]) -> Table:
    """Wall time until every board knew the maximum, for processes."""
    columns = (*_CASE, "epochs", "p50", "p90", "p99", "max")
    table = _table("Wall time until every board knows the maximum, in ms", columns)
    for above, row in _sections(table, rows):
        table.add_row(*_case(row, above), f"{row.epochs:,}", *map(_ms, row.wall_ms))
    return table


LEGEND = """\
A round is a tick. d: diameter, the hops from end to end. R: rounds until the
boards latch. by d, by R: epochs in which all knew the maximum by then.
none, one, more: epochs with so many boards enabled after R rounds.
"""


def theory_table(found: Iterable[TheoryComparison]) -> Table:
    """The line of three at R = 2: measured beside theory."""
    table = _table(
        "The line of three at R = 2: measured, and the closed form",
        (
            "loss",
            "largest, second",
            "epochs",
            "several\nenabled",
            "theory",
            "agreed\nin 2",
            "theory",
            "mean\nrounds",
            "theory",
        ),
    )
    last = None
    for row in found:
        if last not in (None, row.loss):
            table.add_section()
        table.add_row(
            f"{row.loss:.0%}" if row.loss != last else "",
            row.place,
            f"{row.epochs:,}",
            *_shares(row.several_enabled),
            *_shares(row.agreed),
            f"{row.mean_rounds.measured:.3f}",
            f"{row.mean_rounds.theory:.3f}",
        )
        last = row.loss
    return table


_CASE = ("graph", "boards", "d", "R", "loss")


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(
        box=box.SIMPLE_HEAD,
        title=title,
        title_style="bold",
        title_justify="left",
        padding=(0, 1, 0, 0),
        show_edge=False,
    )
    for heading in headings:
        words = heading in ("graph", "largest, second")
        table.add_column(heading, justify="left" if words else "right", no_wrap=True)
    return table


def _sections(
    table: Table, rows: Iterable[ConsensusRow]
) -> Iterator[tuple[ConsensusRow | None, ConsensusRow]]:
    """Each row and the one above it in its section: the same graph."""
    above = None
    for row in rows:
        if above is not None and above.graph != row.graph:
            table.add_section()
            above = None
        yield above, row
        above = row


def _case(row: ConsensusRow, above: ConsensusRow | None) -> Iterator[str]:
    """What a row is of; what the row above says too is left out."""
    same_boards = above is not None and above.boards == row.boards
    yield "" if above is not None else row.graph
    yield "" if same_boards else str(row.boards)
    yield "" if same_boards else str(row.diameter)
    yield "" if same_boards else str(row.rounds)
    yield f"{row.loss:.0%}"


def _rounds(value: float | None) -> str:
    return NEVER if value is None else f"{value:.0f}"


def _ms(value: float | None) -> str:
    return NEVER if value is None else f"{value:.2f}"


def _shares(pair: MeasuredAndExpected) -> tuple[str, str]:
    return f"{pair.measured:.1%}", f"{pair.theory:.1%}"
