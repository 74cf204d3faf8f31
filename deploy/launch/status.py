"""How a running robot is, for a terminal: boards, links, deadlines, and what is wrong."""

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from protocol.wire.frames import Reason
from protocol.wire.storms import Storm


def status_shown(now: dict[str, Any]) -> Iterator[Table | str]:
    """What the plant says of its robot, as tables and lines."""
    seconds = now["tick"] * now["tick_s"]
    waits = f"; waits for {', '.join(now['waits_for'])}" if now["waits_for"] else ""
    yield f"tick {now['tick']} ({seconds:.3f} s){waits}"
    yield _boards(now["boards"])
    for board in now["boards"]:
        for line in _troubles(board):
            yield f"{board['joint']}: {line}"
    for broken in now["sensor_faults"]:
        yield f"{broken['joint']}: {broken['sensor']} is {broken['fault']}"
    links = Table("link", "faults", "", box=None)
    for link in now["links"]:
        faults = ", ".join(
            "cut" if name == "cut" else f"{name} {value:g}"
            for name, value in link["faults"].items()
        )
        one_way = "not heard" if link["one_way"] else ""
        links.add_row(f"{link['from']} to {link['to']}", faults or "none", one_way)
    yield links
    if "realtime" in now:
        yield _deadlines(now["realtime"], now["tick_s"])
    for storm in now["storms"]:
        yield str(Storm(storm["origin"], storm["per_s"], Reason(storm["reason"])))


def _boards(boards: list[dict[str, Any]]) -> Table:
    columns = ("board", "incarnation", "state", "enabled", "torque (N m)", "fault")
    table = Table(*columns, box=None)
    for board in boards:
        torque = f"{board['torque_nm']:.2f}" if "torque_nm" in board else "-"
        enabled = "yes" if board["enabled"] else "no"
        fault = str(board["fault"]["code"]) if board["fault"] else "-"
        about = board["joint"], str(board["incarnation"]), board["state"]
        table.add_row(*about, enabled, torque, fault)
    return table


def _troubles(board: dict[str, Any]) -> Iterator[str]:
    """What a board counts that is not 0, and what has failed on it."""
    counted = [f"{name} {count}" for name, count in board["counters"].items() if count]
    if counted:
        yield ", ".join(counted)
    if board["stuck"]:
        yield f"was stuck {board['stuck']} times"
    if board["fault"]:
        first, *_ = board["fault"]["text"].splitlines()
        yield f"fault {board['fault']['code']} ({board['fault']['name']}), {first}"


def _deadlines(boards: list[dict[str, Any]], tick_s: float) -> Table:
    """How boards in realtime keep their time."""
    table = Table("board", "rate", "missed", "woke late at worst (ms)", "torque age (ms)", box=None)
    for board in boards:
        age_ticks = board["torque_age_ticks"]
        age = "-" if age_ticks is None else f"{age_ticks * tick_s * 1e3:g}"
        missed = f"{board['missed']} of {board['periods']}"
        late = f"{board['late_ms_max']:.1f}"
        table.add_row(board["joint"], f"{board['rate_hz']:g} Hz", missed, late, age)
    return table
