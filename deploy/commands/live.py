"""Commands on a running robot: cut, heal, loss, delay, push, reference, sensor, and so on."""

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from deploy.commands.terminal import JsonOption, out, print_json
from deploy.launch.status import status_shown
from deploy.scenario_file.fault_amount import amount_of
from deploy.scenario_file.ticks import MeaningError, whole_ticks
from protocol.robot import events
from protocol.robot.events import DELAY_TICKS_MAX, Command
from protocol.robot.sensors import FAULTS, Faultable, FaultKind

if TYPE_CHECKING:
    from deploy.scenario_file.sensor_faults import FaultAmounts

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


AMOUNT_HELP = "How large the fault is: " + ", ".join(
    f"{taken.key.removesuffix('_ms')} of {fault}, such as {taken.default:g}{'ms' * taken.in_ms}"
    for fault in FAULTS
    if (taken := amount_of(fault)) is not None
)


def cut(
    link: LinkArgument,
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Cut a link: no frame passes it any more.

    Example: decmesh cut ankle-knee
    """
    _change(link, {"cut": 1.0}, rig, one_way=one_way, as_json=as_json)


def heal(
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make a link perfect again, or all of them.

    Example: decmesh heal
    """

    def command(status: dict[str, Any], live: Any) -> Command:
        return events.LinkRepair(live.pairs_of(link, status, one_way=one_way))

    _do(command, rig, as_json=as_json)


def loss(
    probability: Annotated[float, typer.Argument(min=0.0, max=1.0, help="0 to 1.")],
    link: LinkArgument = "all",
    one_way: OneWayOption = False,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Lose frames at random, each with a probability.

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
    """Delay all frames of a link, or of all links.

    Example: decmesh delay 5ms ankle-knee
    """
    late_s = quantity(time, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        pairs, tick_ms = live.pairs_of(link, status, one_way=one_way), 1e3 * status["tick_s"]
        ticks = whole_ticks(1e3 * late_s, tick_ms)
        if ticks is None or not 0 <= ticks <= DELAY_TICKS_MAX:
            most = f"{DELAY_TICKS_MAX * tick_ms:g} ms, in whole ticks of {tick_ms:g} ms"
            raise typer.BadParameter(f"{time!r} cannot be; a delay is from 0 to {most}")
        return events.LinkChange(pairs, {"delay_ticks": float(ticks)})

    _do(command, rig, as_json=as_json)


def push(
    force: Annotated[str, typer.Argument(help="Such as 40N; forward positive.")],
    duration: Annotated[str, typer.Option("--for", help="How long, such as 100ms.")] = "100ms",
    segment: Annotated[str | None, typer.Option("--at", help="Link; default: the top.")] = None,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Push the body: a horizontal force at a link's centre of mass.

    Forward is positive; backward: decmesh push -- -40N

    Example: decmesh push 40N --for 100ms --at trunk
    """
    force_n, duration_s = quantity(force, "force"), quantity(duration, "time")

    def command(status: dict[str, Any], live: Any) -> Command:
        names = status["segments"]
        link = len(names) - 1 if segment is None else live.index_of(segment, names, "segment")
        return events.Push(link, force_n, max(1, round(duration_s / status["tick_s"])))

    _do(command, rig, as_json=as_json)


def reference(
    joint: JointArgument,
    angle: Annotated[str, typer.Argument(help="Such as 5deg.")],
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Give a board another reference.

    Example: decmesh reference hip 5deg
    """
    rad = quantity(angle, "angle")
    _of_joint(joint, lambda board: events.ReferenceChange(board, rad), rig, as_json=as_json)


def sensor(
    joint: JointArgument,
    fault: Annotated[FaultKind, typer.Argument(help="What is wrong with it.")],
    which: Annotated[Faultable, typer.Option("--of", help="Which of its sensors.")] = "encoder",
    duration: Annotated[str | None, typer.Option("--for", help="Such as 500ms.")] = None,
    amount: Annotated[str | None, typer.Option(help=AMOUNT_HELP)] = None,
    rig: RigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Let a sensor of a board fail, or repair it (ok).

    Example: decmesh sensor knee stuck --for 500ms
    """
    from deploy.scenario_file.sensor_faults import fault_amount  # noqa: PLC0415 - as below

    for_ms = None if duration is None else quantity(duration, "time") * 1e3
    given = _amount_given(fault, amount)

    def command(status: dict[str, Any], live: Any) -> Command:
        tick_ms = status["tick_s"] * 1e3
        try:
            size = fault_amount(fault, given, tick_ms=tick_ms)
        except MeaningError as error:
            raise typer.BadParameter(str(error)) from error
        ticks = 0 if for_ms is None else max(1, round(for_ms / tick_ms))
        joints = [board["joint"] for board in status["boards"]]
        board = live.index_of(joint, joints, "joint")
        return events.SensorFault(board, which, fault, size, ticks)

    _do(command, rig, as_json=as_json)


def unplug(joint: JointArgument, rig: RigOption = None, as_json: JsonOption = False) -> None:
    """Pull a board: its process is killed.

    Example: decmesh unplug knee
    """
    _of_joint(joint, events.Unplug, rig, as_json=as_json)


def plug(joint: JointArgument, rig: RigOption = None, as_json: JsonOption = False) -> None:
    """Put in a new board where one was pulled.

    Example: decmesh plug knee
    """
    _of_joint(joint, events.Plug, rig, as_json=as_json)


def status(rig: RigOption = None, as_json: JsonOption = False) -> None:
    """Show tick, boards, links, and who is waited for.

    Example: decmesh status
    """
    from deploy.launch import terminal_session as live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
    if as_json:
        print_json(now)
        return
    for shown in status_shown(now):
        if isinstance(shown, Table):
            out.print(shown)
        else:
            out.print(shown, highlight=False, markup=False, soft_wrap=True)


ALL = (cut, heal, loss, delay, push, reference, sensor, unplug, plug, status)


def _change(
    link: str, changes: dict[str, float], rig: str | None, *, one_way: bool, as_json: bool
) -> None:
    def command(status: dict[str, Any], live: Any) -> Command:
        return events.LinkChange(live.pairs_of(link, status, one_way=one_way), changes)

    _do(command, rig, as_json=as_json)


def _of_joint(
    joint: str, made: Callable[[int], Command], rig: str | None, *, as_json: bool
) -> None:
    def command(status: dict[str, Any], live: Any) -> Command:
        joints = [board["joint"] for board in status["boards"]]
        return made(live.index_of(joint, joints, "joint"))

    _do(command, rig, as_json=as_json)


def _amount_given(fault: FaultKind, text: str | None) -> "FaultAmounts":
    """A fault's size as somebody typed it, under the key of its kind."""
    from deploy.scenario_file.sensor_faults import FaultAmounts  # noqa: PLC0415 - pydantic, needed only now

    if text is None:
        return FaultAmounts()
    taken = amount_of(fault)
    if taken is None:
        raise typer.BadParameter(f"a sensor that is {fault} has no --amount")
    try:
        value = quantity(text, "time") * 1e3 if taken.in_ms else float(text)
        return FaultAmounts.model_validate({taken.key: value})
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is no {taken.key} of a sensor") from error


def _do(command: Any, rig: str | None, *, as_json: bool) -> None:
    """Ask the plant for what it knows, make the command from it, and have it carried out."""
    from deploy.launch import terminal_session as live  # noqa: PLC0415 - only who talks to a robot needs the network

    with live.Terminal(live.find_rig(rig)) as terminal:
        now = terminal.status()
        tick = terminal.command(command(now, live))
    at_s = tick * now["tick_s"]
    if as_json:
        print_json({"tick": tick, "at_s": at_s})
    else:
        print(f"takes effect in tick {tick} ({at_s:.3f} s)")
