"""Controllers from outside: where their files are, and whether they fit through their doors.

Rule: a controller that cannot work is found before anything is started, with file and key of the
scenario that names it. To find out, its file is executed, but no controller is made.

`my_module:MyServo` means the class `MyServo` of `my_module.py`, which lies beside the scenario, or
beside one that it extends, or in the working folder, or where Python finds it by itself.
"""

import hashlib
import inspect
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stdout
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator

from module_agent.custom import sandbox as foreign
from module_agent.firmware.config import Source
from protocol.robot.scenario import ScenarioError


def _reference(text: str) -> str:
    if re.fullmatch(r"([A-Za-z_]\w*\.)*[A-Za-z_]\w*:[A-Za-z_]\w*", text) is None:
        raise ValueError(f"{text!r} names no class; write it like my_module:MyClass")
    return text


def _of_boards(named: Any) -> Any:
    match named:
        case str():
            _reference(named)
        case dict() if all(isinstance(reference, str) for reference in named.values()):
            for reference in named.values():
                _reference(reference)
        case _:
            raise ValueError(
                "must be a class, such as my_module:MyServo, or a table with one for each joint"
            )
    return named


Reference = Annotated[str, AfterValidator(_reference)]
"""A class in a file of the user's own, such as `my_module:MyServo`."""
ControllerOfBoards = Annotated[Any, AfterValidator(_of_boards)]
"""One class for all boards, or one each for some joints."""


class ControllerInterface(NamedTuple):
    """What a class must have to be taken for a controller."""

    method: str
    argument: str


SERVO, ELECTION = ControllerInterface("torque_nm", "seen"), ControllerInterface("vote", "now")


class Controllers(NamedTuple):
    """What a scenario names, and what is wrong with it."""

    sources: dict[str, Source]
    """By reference, such as `my_module:MyServo`."""
    complaints: list[str]
    """Each as `path: reason`."""


def find(tree: dict[str, Any], folders: Sequence[Path]) -> Controllers:
    """Find and try every class that a scenario names, whatever else may be wrong with it."""
    found = Controllers({}, list(_strangers(tree)))
    for path, reference, door in _named(tree):
        module, _, _name = reference.partition(":")
        file = _file(module, [*folders, Path.cwd()])
        if file is None:
            where = ", ".join(map(str, dict.fromkeys(folders)))
            found.complaints.append(
                f"{path}: there is no {module.replace('.', '/')}.py in {where}, the working folder,"
                f" or where Python looks for modules"
            )
            continue
        source = Source(reference, str(file), hashlib.sha256(file.read_bytes()).hexdigest())
        found.sources[reference] = source
        trouble = _misfit(source, door)
        if trouble is not None:
            found.complaints.append(f"{path}: {trouble}")
    return found


def reference_for(joint: str, own: str | None, common: Any) -> str | None:
    """Which controller a board has: its own, or what is said for its joint, or for all."""
    found: str | None = own or (common.get(joint) if isinstance(common, dict) else common)
    return found


def _named(tree: dict[str, Any]) -> Iterator[tuple[str, str, ControllerInterface]]:
    """Every class that a scenario names: path of the key, reference, and which door it is for."""
    boards, common, election = tree.get("board"), tree.get("controller"), tree.get("election")
    named = [
        (f"board.{i}.controller", board.get("controller"), SERVO)
        for i, board in enumerate(boards if isinstance(boards, list) else [])
        if isinstance(board, dict)
    ]
    if isinstance(common, dict):
        named += [(f"controller.{joint}", one, SERVO) for joint, one in common.items()]
    else:
        named.append(("controller", common, SERVO))
    if isinstance(election, dict):
        named.append(("election.rule", election.get("rule"), ELECTION))
    for path, reference, door in named:
        if isinstance(reference, str) and reference.count(":") == 1:
            yield path, reference, door


def _strangers(tree: dict[str, Any]) -> Iterator[str]:
    """Joints that have a controller but are none of the body's."""
    boards, common = tree.get("board"), tree.get("controller")
    if isinstance(common, dict) and isinstance(boards, list):
        joints = [board.get("joint") for board in boards if isinstance(board, dict)]
        for joint in common:
            if joint not in joints:
                known = ", ".join(map(str, joints))
                yield f"controller.{joint}: the body has no such joint; it has {known}"


def _file(module: str, folders: Sequence[Path]) -> Path | None:
    """The file of a module: in one of the folders, or where Python would import it from."""
    for folder in folders:
        path = folder.joinpath(*module.split(".")).with_suffix(".py")
        if path.is_file():
            return path.resolve()
    places: Sequence[str] | None = sys.path
    parts, spec = module.split("."), None
    for end in range(len(parts)):
        spec = PathFinder.find_spec(".".join(parts[: end + 1]), places)
        if spec is None:
            return None
        places = spec.submodule_search_locations
    origin = "" if spec is None else spec.origin or ""
    return Path(origin) if origin.endswith(".py") else None


def _misfit(source: Source, door: ControllerInterface) -> str | None:
    """Why a class cannot be taken for a controller; None if it can."""
    try:
        with redirect_stdout(sys.stderr):  # What we print ourselves may be read by a program.
            made = foreign.load(source)
    except ScenarioError as error:
        return str(error)
    except foreign.FAILURES as error:
        what, *where = foreign.summary(error)
        return f"{source.reference}: {what}" + (f" ({where[0]})" if where else "")
    method = getattr(made, door.method, None)
    if not callable(method):
        return f"{source.reference}: has no method {door.method}({door.argument})"
    if not _takes(made, 1):
        return f"{source.reference}: must be made with one argument, the board's config"
    if not _takes(method, 2):
        return f"{source.reference}: {door.method} must take one argument, {door.argument}"
    return None


def _takes(what: Callable[..., Any], count: int) -> bool:
    """Whether something can be called with so many positional arguments."""
    try:
        inspect.signature(what).bind(*[None] * count)
    except TypeError:
        return False
    return True
