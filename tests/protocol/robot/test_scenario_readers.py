"""A resolved scenario is read by name: nothing outside its module looks into it by key.

A `Scenario` cannot be looked into by key, and mypy says so. What is left is to make tables of one,
or never to make a `Scenario` of the tables; both are looked for here, and so is any reading by a
key that scenarios have.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest

from protocol.robot.scenario import Scenario

ROOT = Path(__file__).parents[3]
OWN = "protocol/robot/scenario.py"
FILES_OF_USERS = "deploy/scenario_file/"
"""Where the tables are those that a user wrote, before they have become a scenario."""
OTHER_DOCUMENTS = {
    "status": "what a plant answers to a terminal",
    "now": "the same",
    "board": "a board of that",
    "broken": "a fault of that",
    "rig": "a rig file",
    "run": "a run's summary",
    "summary": "the same",
    "body": "a message of a recording",
    "facts": "facts of a run",
    "found": "words of a pattern",
    "_ask": "an answer of a plant",
    "_epochs": "messages of a recording",
}
"""Names of JSON tables that have some keys in common with a scenario."""


def keys(kind: Any) -> Iterator[str]:
    """Every key of the JSON of a structure, with those of the structures in it."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        for field in msgspec.structs.fields(kind):
            yield field.encode_name
            yield from keys(field.type)
    else:
        for inner in get_args(kind):
            yield from keys(inner)


KEYS = frozenset(keys(Scenario))


def looked_up(node: ast.AST) -> tuple[ast.expr, str] | None:
    """What is looked into by a text, and by which, if this does so."""
    match node:
        case ast.Subscript(value=of, slice=ast.Constant(value=str(key)), ctx=ast.Load()):
            return of, key
        case ast.Call(
            func=ast.Attribute(value=of, attr="get" | "pop"),
            args=[ast.Constant(value=str(key)), *_],
        ):
            return of, key
        case ast.Compare(
            left=ast.Constant(value=str(key)), ops=[ast.In() | ast.NotIn()], comparators=[of]
        ):
            return of, key
    return None


def last_name(of: ast.expr) -> str:
    """The name by which a table is known where it is looked into."""
    match of:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
        case ast.Subscript(value=inner) | ast.Call(func=inner):
            return last_name(inner)
    return ""


def offences(tree: ast.AST) -> Iterator[str]:
    """Where a scenario is taken for a table, each as the code that does."""
    for node in ast.walk(tree):
        found = looked_up(node)
        if found is not None and found[1] in KEYS and last_name(found[0]) not in OTHER_DOCUMENTS:
            yield ast.unparse(node)
        match node:
            case ast.arg(arg=name, annotation=ast.expr() as kind):
                yield from _tables_called_scenario(name, kind)
            case ast.AnnAssign(target=target, annotation=kind):
                yield from _tables_called_scenario(last_name(target), kind)
            case ast.Call(func=ast.Attribute(attr="to_builtins"), args=[of, *_]):
                if last_name(of) != "event":  # An array, without any key.
                    yield ast.unparse(node)


def _tables_called_scenario(name: str, kind: ast.expr) -> Iterator[str]:
    written = ast.unparse(kind)
    if "scenario" in name.lower() and ("dict" in written or "Any" in written):
        yield f"{name}: {written}"


def product() -> list[Path]:
    packages = ("protocol", "module_agent", "plant_server", "deploy")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    return [path for path in files if _name(path) != OWN]


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_nothing_outside_its_module_reads_a_scenario_by_key() -> None:
    found = {
        _name(path): offences_here
        for path in product()
        if not _name(path).startswith(FILES_OF_USERS)
        and (offences_here := list(offences(ast.parse(path.read_bytes()))))
    }
    assert found == {}


def test_a_scenario_is_decoded_in_one_place() -> None:
    readers = [_name(path) for path in product() if "Decoder(Scenario)" in path.read_text("utf-8")]
    assert readers == []
    assert (ROOT / OWN).read_text("utf-8").count("Decoder(Scenario)") == 1


@pytest.mark.parametrize(
    "code",
    [
        'scenario["run"]',
        'values["board"][0]["joint"]',
        'trajectory.scenario["election"]["rounds"]',
        'tables.get("realtime")',
        '"pace" in values["run"]',
        "def read(scenario: dict[str, Any]) -> None: ...",
        "self.scenario: dict[str, Any] = {}",
        "msgspec.to_builtins(scenario)",
    ],
)
def test_a_reader_by_key_would_be_found(code: str) -> None:
    assert list(offences(ast.parse(code)))


def test_the_keys_are_those_of_the_whole_scenario() -> None:
    assert {"board", "link_names", "kp_nm_rad", "overrun_ticks", "class", "ticks_per_round"} <= KEYS
    assert "boards" not in KEYS
