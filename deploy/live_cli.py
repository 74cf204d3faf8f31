"""Commands on a running robot: cut, heal, loss, delay, push, reference, unplug, plug, status."""

import json
import math
import re
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from protocol.commands import Command

RigOption = Annotated[
    str | None,
    typer.Option("--rig", help="Which robot: its base port, scenario or run folder, or HOST:PORT."),
]
LinkArgument = Annotated[str, typer.Argument(help="A link, such as ankle-knee, or all.")]
OneWayOption = Annotated[
    bool, typer.Option("--one-way", help="Only from the first joint's board to the second's.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]

QUANTITIES: dict[str, dict[str, float]] = {
    "force": {"N": 1.0, "kN": 1000.0},
    "time": {"ms": 1e-3, "s": 1.0},
    "angle": {"deg": math.pi / 180.0, "rad": 1.0},
}


def quantity(text: str, kind: str) -> float:
    """Read a number with its unit, such as 40N, 5ms or 3deg. Raises `typer.BadParameter`."""
    units = QUANTITIES[kind]
    match = re.fullmatch(rf"([-+]?[0-9]*\.?[0-9]+)({'|'.join(units)})", text.strip())
    if match is None:
        example = f"5{next(iter(units))}"
        raise typer.BadParameter(f"{text!r} is no {kind}; write it like {example}")
    return float(match[1]) * units[match[2]]


def cut(link: LinkArgument, one_way: OneWayOption = False, rig: RigOption = None) -> None:
    """Cut a link of the running robot.

    Example: decmesh cut ankle-knee
    """
    _change(link, {"cut": 1.0}, rig, one_way=one_way)


def heal(link: LinkArgument = "all", one_way: OneWayOption = False, rig: RigOption = None) -> None:
    """Make a link of the running robot perfect again, or all of them.

    Example: decmesh heal
    """
    _do(lambda status, live: ["heal", live.pairs_of(link, status, one_way=one_way)], rig)


def loss(
    probability: Annotated[float, typer.Argument(min=0.0, max=1.0)],
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
) -> None:
    """Lose frames at random, each with a probability.

    Example: decmesh loss 0.2 knee-hip
    """
    _change(link, {"loss": probability}, rig, one_way=one_way)


def delay(
    time: Annotated[str, typer.Argument(help="How late frames come, such as 5ms.")],
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
) -> None:
    """Let frames come late.

    Example: decmesh delay 5ms ankle-knee
    """
    late_s = quantity(time, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        ticks = float(round(late_s / status["tick_s"]))
        return ["link", live.pairs_of(link, status, one_way=one_way), {"delay_ticks": ticks}]

    _do(command, rig)


def push(
    force: Annotated[str, typer.Argument(help="Such as 40N; forward positive.")],
    duration: Annotated[str, typer.Option("--for", help="How long, such as 100ms.")] = "100ms",
    segment: Annotated[str | None, typer.Option("--at", help="Link; default: the top.")] = None,
    rig: RigOption = None,
) -> None:
    """Push the body at the centre of mass of a link.

    Example: decmesh push 40N --for 100ms --at trunk
    """
    force_n, duration_s = quantity(force, "force"), quantity(duration, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        names = status["segments"]
        link = len(names) - 1 if segment is None else live.index_of(segment, names, "segment")
        return ["push", link, force_n, max(1, round(duration_s / status["tick_s"]))]

    _do(command, rig)


def reference(
    joint: str,
    angle: Annotated[str, typer.Argument(help="Such as 5deg.")],
    rig: RigOption = None,
) -> None:
    """Give a board another reference.

    Example: decmesh reference hip 5deg
    """
    rad = quantity(angle, "angle")
    _do(
        lambda status, live: ["reference", live.index_of(joint, _joints(status), "joint"), rad], rig
    )


def unplug(joint: str, rig: RigOption = None) -> None:
    """Pull a board: its process is killed.

    Example: decmesh unplug knee
    """
    _do(lambda status, live: ["unplug", live.index_of(joint, _joints(status), "joint")], rig)


def plug(joint: str, rig: RigOption = None) -> None:
    """Put a new board in where one was pulled.

    Example: decmesh plug knee
    """
    _do(lambda status, live: ["plug", live.index_of(joint, _joints(status), "joint")], rig)


def status(rig: RigOption = None, as_json: JsonOption = False) -> None:
    """Show the running robot: tick, boards and links.

    Example: decmesh status
    """
    from deploy import live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
    if as_json:
        print(json.dumps(now, indent=2))
        return
    out = Console()
    seconds = now["tick"] * now["tick_s"]
    waits = f"; waits for {', '.join(now['waits_for'])}" if now["waits_for"] else ""
    out.print(f"tick {now['tick']} ({seconds:.3f} s){waits}", highlight=False)
    boards = Table("board", "incarnation", "state", "enabled", "torque (N m)", box=None)
    for board in now["boards"]:
        torque = f"{board['torque_nm']:.2f}" if "torque_nm" in board else "-"
        enabled = "yes" if board["enabled"] else "no"
        boards.add_row(board["joint"], str(board["incarnation"]), board["state"], enabled, torque)
    out.print(boards)
    links = Table("link", "faults", "", box=None)
    for link in now["links"]:
        faults = ", ".join(f"{name} {value:g}" for name, value in link["faults"].items())
        one_way = "not heard" if link["one_way"] else ""
        links.add_row(f"{link['from']} to {link['to']}", faults or "none", one_way)
    out.print(links)
    if "realtime" in now:
        out.print(_deadlines(now["realtime"], now["tick_s"]))


ALL = (cut, heal, loss, delay, push, reference, unplug, plug, status)


def _deadlines(boards: list[dict[str, Any]], tick_s: float) -> Table:
    """How boards in realtime keep their time."""
    table = Table("board", "rate", "missed", "woke late (ms)", "torque age (ms)", box=None)
    for board in boards:
        age_ticks = board["torque_age_ticks"]
        age = "-" if age_ticks is None else f"{age_ticks * tick_s * 1e3:g}"
        missed = f"{board['missed']} of {board['periods']}"
        late = f"{board['late_ms_max']:.1f}"
        table.add_row(board["joint"], f"{board['rate_hz']:g} Hz", missed, late, age)
    return table


def _joints(status: dict[str, Any]) -> list[str]:
    return [board["joint"] for board in status["boards"]]


def _change(link: str, changes: dict[str, float], rig: str | None, *, one_way: bool) -> None:
    _do(lambda status, live: ["link", live.pairs_of(link, status, one_way=one_way), changes], rig)


def _do(command: Any, rig: str | None) -> None:
    """Ask the plant for what it knows, make the command from it, and have it carried out."""
    from deploy import live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
        tick = terminal.command(command(now, live))
    print(f"takes effect in tick {tick} ({tick * now['tick_s']:.3f} s)")
