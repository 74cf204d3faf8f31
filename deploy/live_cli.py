"""Commands on a running robot: cut, heal, loss, delay, push, reference, unplug, plug, status."""

import math
import re
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from rich.table import Table

from deploy.terminal import JsonOption, out, print_json
from protocol.commands import Command
from protocol.frames import Reason
from protocol.storms import Storm

RigOption = Annotated[
    str | None,
    typer.Option("--rig", help="Which robot: its base port, scenario or run folder, or HOST:PORT."),
]
LinkArgument = Annotated[str, typer.Argument(help="A link, such as ankle-knee, or all.")]
JointArgument = Annotated[str, typer.Argument(help="A joint, such as knee.")]
OneWayOption = Annotated[
    bool, typer.Option("--one-way", help="Only from the first joint's board to the second's.")
]

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


def cut(
    link: LinkArgument,
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Nothing passes a link any more.

    Example: decmesh cut ankle-knee
    """
    _change(link, {"cut": 1.0}, rig, one_way=one_way, as_json=as_json)


def heal(
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """A link is perfect again, or all of them are.

    Example: decmesh heal
    """

    def command(status: dict[str, Any], live: Any) -> Command:
        return ["heal", live.pairs_of(link, status, one_way=one_way)]

    _do(command, rig, as_json=as_json)


def loss(
    probability: Annotated[float, typer.Argument(min=0.0, max=1.0, help="0 to 1.")],
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Frames are lost at random, each with a probability.

    Example: decmesh loss 0.2 knee-hip
    """
    _change(link, {"loss": probability}, rig, one_way=one_way, as_json=as_json)


def delay(
    time: Annotated[str, typer.Argument(help="How late frames come, such as 5ms.")],
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Frames come late.

    Example: decmesh delay 5ms ankle-knee
    """
    late_s = quantity(time, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        ticks = float(round(late_s / status["tick_s"]))
        return ["link", live.pairs_of(link, status, one_way=one_way), {"delay_ticks": ticks}]

    _do(command, rig, as_json=as_json)


def push(
    force: Annotated[str, typer.Argument(help="Such as 40N; forward positive.")],
    duration: Annotated[str, typer.Option("--for", help="How long, such as 100ms.")] = "100ms",
    segment: Annotated[str | None, typer.Option("--at", help="Link; default: the top.")] = None,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """A horizontal force pushes the body, at a link's centre of mass.

    Forward is positive; backward: decmesh push -- -40N

    Example: decmesh push 40N --for 100ms --at trunk
    """
    force_n, duration_s = quantity(force, "force"), quantity(duration, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        names = status["segments"]
        link = len(names) - 1 if segment is None else live.index_of(segment, names, "segment")
        return ["push", link, force_n, max(1, round(duration_s / status["tick_s"]))]

    _do(command, rig, as_json=as_json)


def reference(
    joint: JointArgument,
    angle: Annotated[str, typer.Argument(help="Such as 5deg.")],
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Another goal for a board.

    Example: decmesh reference hip 5deg
    """
    _of_joint(joint, "reference", [quantity(angle, "angle")], rig, as_json=as_json)


def unplug(joint: JointArgument, rig: RigOption = None, as_json: JsonOption = False) -> None:
    """A board is pulled: its process is killed.

    Example: decmesh unplug knee
    """
    _of_joint(joint, "unplug", [], rig, as_json=as_json)


def plug(joint: JointArgument, rig: RigOption = None, as_json: JsonOption = False) -> None:
    """A new board is put in where one was pulled.

    Example: decmesh plug knee
    """
    _of_joint(joint, "plug", [], rig, as_json=as_json)


def status(rig: RigOption = None, as_json: JsonOption = False) -> None:
    """How the robot is: tick, boards, links, who is waited for.

    Example: decmesh status
    """
    from deploy import live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
    if as_json:
        print_json(now)
        return
    seconds = now["tick"] * now["tick_s"]
    waits = f"; waits for {', '.join(now['waits_for'])}" if now["waits_for"] else ""
    out.print(f"tick {now['tick']} ({seconds:.3f} s){waits}", highlight=False)
    out.print(_boards(now["boards"]))
    for board in now["boards"]:
        for line in _troubles(board):
            out.print(f"{board['joint']}: {line}", highlight=False, markup=False, soft_wrap=True)
    links = Table("link", "faults", "", box=None)
    for link in now["links"]:
        faults = ", ".join(f"{name} {value:g}" for name, value in link["faults"].items())
        one_way = "not heard" if link["one_way"] else ""
        links.add_row(f"{link['from']} to {link['to']}", faults or "none", one_way)
    out.print(links)
    if "realtime" in now:
        out.print(_deadlines(now["realtime"], now["tick_s"]))
    for storm in now["storms"]:
        seen = Storm(storm["origin"], storm["per_s"], Reason(storm["reason"]))
        out.print(str(seen), highlight=False)


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


def _change(
    link: str, changes: dict[str, float], rig: str | None, *, one_way: bool, as_json: bool
) -> None:
    def command(status: dict[str, Any], live: Any) -> Command:
        return ["link", live.pairs_of(link, status, one_way=one_way), changes]

    _do(command, rig, as_json=as_json)


def _of_joint(
    joint: str, name: str, values: list[float], rig: str | None, *, as_json: bool
) -> None:
    def command(status: dict[str, Any], live: Any) -> Command:
        joints = [board["joint"] for board in status["boards"]]
        return [name, live.index_of(joint, joints, "joint"), *values]

    _do(command, rig, as_json=as_json)


def _do(command: Any, rig: str | None, *, as_json: bool) -> None:
    """Ask the plant for what it knows, make the command from it, and have it carried out."""
    from deploy import live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
        tick = terminal.command(command(now, live))
    at_s = tick * now["tick_s"]
    if as_json:
        print_json({"tick": tick, "at_s": at_s})
    else:
        print(f"takes effect in tick {tick} ({at_s:.3f} s)")
