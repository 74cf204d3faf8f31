"""How a run in realtime kept its time, for a terminal: a row for each board, and a verdict."""

from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

MISSED_SHARE_MAX = 0.01
"""With more deadlines missed than this, the host was too slow for the rates that were asked for."""


COLUMNS = {
    "period": "period_ms",
    "computing": "busy_ms",
    "torque age": "torque_age_ms",
    "decision": "decision_ms",
}


def realtime_table(realtime: dict[str, Any]) -> Group:
    """Draw the `realtime` part of a summary."""
    table = Table(
        "board",
        "missed",
        *COLUMNS,
        box=None,
        title="Realtime; median / 99 % / largest, in ms",
        title_justify="left",
        title_style="bold",
    )
    for joint, board in realtime["boards"].items():
        missed = f"{board['late'] + board['skipped']} of {board['periods']}"
        table.add_row(joint, missed, *(_spread(board[key]) for key in COLUMNS.values()))
    return Group(table, Text(verdict(realtime)))


def verdict(realtime: dict[str, Any]) -> str:
    """Whether the host was quick enough, and by how much it was not."""
    boards = realtime["boards"]
    slow = {
        joint: board["missed_share"]
        for joint, board in boards.items()
        if (board["missed_share"] or 0.0) > MISSED_SHARE_MAX
    }
    told = [f"{joint} missed {share:.1%} of its deadlines" for joint, share in slow.items()]
    if realtime["slipped_s"]:
        told.append(f"the plant gave up {realtime['slipped_s']:.2f} s of wall time")
    stale = sum(board["torque_stale_ticks"] for board in boards.values())
    if stale:
        told.append(f"in {stale} ticks a torque was too old to be applied")
    if told:
        return f"The host was too slow for this: {'; '.join(told)}."
    return "The host was quick enough for this."


def _spread(spread: dict[str, float | None]) -> str:
    return "/".join("-" if value is None else f"{value:.1f}" for value in spread.values())
