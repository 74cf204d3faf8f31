"""The architecture is a test: who may import what, how large a piece may grow, what lies where."""

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PRODUCT = ("protocol", "module_agent", "plant_server", "deploy")
FOLDERS = {*PRODUCT, "tests", ".ci"}
SCRATCH = {"runs", "build", "__pycache__"}
"""What using the project leaves at the top level."""

RUNTIME_FOLDERS = ("module_agent/process/", "plant_server/process/")
"""Where boards and plant meet the operating system and the network; nowhere else do they."""
TALKS_TO_A_RIG = {"deploy/launch/terminal_session.py", "deploy/launch/zenoh_echo.py"}
"""Modules of `deploy` that may open a Zenoh session."""
IMPURE_FOLDERS = (*RUNTIME_FOLDERS, "protocol/process/", "plant_server/spool/")
"""All other code of boards, plant and protocol is pure: what it does follows from its arguments."""
TWO_NAMES = "deploy/decmesh/"
"""Installed, this package is `decmesh`, so it names its own modules by where they are."""
LINES_MAX = 500
FUNCTION_LINES_MAX = 60
"""A ratchet against what grows unseen; what belongs together stays together below it."""


def _files(*packages: str) -> list[Path]:
    files = [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]
    assert files, f"no code in {packages}"
    return files


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _is_main(name: str) -> bool:
    """Whether it is what `python -m` runs: the outermost edge of a process."""
    return name.endswith("/__main__.py")


def _imports(path: Path) -> set[str]:
    """Every module imported anywhere in a file, also within functions, by its top-level name."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level and _name(path).startswith(TWO_NAMES):
                continue
            assert node.level == 0, f"{_name(path)}: imports are absolute"
            assert node.module is not None
            found.add(node.module.partition(".")[0])
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            raise AssertionError(f"{_name(path)}: imports what cannot be read from its text")
    return found


def _importers(module: str, *packages: str) -> set[str]:
    return {_name(path) for path in _files(*packages) if module in _imports(path)}


@pytest.mark.parametrize(
    ("package", "strangers"),
    [
        ("protocol", {"module_agent", "plant_server", "deploy", "tests"}),
        ("module_agent", {"plant_server", "deploy", "tests"}),
        ("plant_server", {"module_agent", "deploy", "tests"}),
        ("deploy", {"tests"}),
    ],
)
def test_packages_know_only_what_is_below_them(package: str, strangers: set[str]) -> None:
    """module_agent -> protocol <- plant_server; only `deploy` and the tests see both."""
    for stranger in strangers:
        assert _importers(stranger, package) == set()


def test_the_protocol_needs_the_standard_library_msgpack_and_msgspec() -> None:
    for path in _files("protocol"):
        foreign = _imports(path) - set(sys.stdlib_module_names) - {"protocol", "msgpack", "msgspec"}
        assert not foreign, _name(path)


def test_a_board_needs_no_more_than_the_protocol_and_zenoh() -> None:
    for path in _files("module_agent"):
        foreign = _imports(path) - set(sys.stdlib_module_names) - {"protocol", "module_agent"}
        assert foreign <= {"zenoh"}, _name(path)


def test_what_is_installed_is_every_folder() -> None:
    """Listed one by one, because `decmesh` is a folder of `deploy` under another name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    installed = project["tool"]["setuptools"]["packages"]
    folders = {path.parent.relative_to(ROOT).as_posix() for path in _files(*PRODUCT)}
    assert sorted(installed) == sorted(
        {folder.replace("/", ".") for folder in folders} | {"decmesh"}
    )


def test_zenoh_is_in_the_runtimes_and_in_what_talks_to_a_rig() -> None:
    users = _importers("zenoh", *PRODUCT)
    assert users >= TALKS_TO_A_RIG
    assert {name for name in users - TALKS_TO_A_RIG if not _is_main(name)} == {
        name for name in users if name.startswith(RUNTIME_FOLDERS)
    }


@pytest.mark.parametrize(
    "clock_or_chance",
    ["time", "datetime", "random", "secrets", "socket", "threading", "asyncio", "uuid"],
)
def test_pure_code_has_no_clock_no_chance_and_no_network(clock_or_chance: str) -> None:
    """The tick is its only clock; what it does follows from the bytes that it was given."""
    found = _importers(clock_or_chance, "protocol", "module_agent", "plant_server")
    assert {name for name in found if not name.startswith(IMPURE_FOLDERS)} == set()


@pytest.mark.parametrize(
    "module",
    [
        "module_agent.process.serving",
        "module_agent.__main__",
        "module_agent.process.elector_runtime",
    ],
)
def test_a_board_process_loads_nothing_heavy(module: str) -> None:
    """A microcontroller's worth of libraries: it starts in well under 0.2 s."""
    code = f"import sys, {module}; print(*sorted({{m.partition('.')[0] for m in sys.modules}}))"
    child = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = set(child.stdout.split())
    assert "module_agent" in loaded
    heavy = {"numpy", "scipy", "matplotlib", "pydantic", "typer", "rich", "mcap", "asyncio"}
    assert not loaded & (heavy | {"plant_server", "deploy"})


def test_files_stay_readable_in_one_go() -> None:
    lines = {
        _name(path): len(path.read_text(encoding="utf-8").splitlines())
        for path in _files(*PRODUCT, "tests")
    }
    assert {name: count for name, count in lines.items() if count > LINES_MAX} == {}


def test_functions_stay_readable_at_a_glance() -> None:
    lines = {
        f"{_name(path)}:{node.name}": (node.end_lineno or 0) - node.lineno + 1
        for path in _files(*PRODUCT)
        for node in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert {name: count for name, count in lines.items() if count > FUNCTION_LINES_MAX} == {}


def _room(module: str) -> str:
    """`deploy.report` for all in that folder or below it; a file beside the folders is its own.

    What `python -m` runs is above the folder that it lies in.
    """
    parts = module.split(".")
    depth = parts.index("__main__") + 1 if "__main__" in parts else 2
    return ".".join(parts[:depth])


def _arrows() -> dict[str, set[str]]:
    """Which room names which others."""
    arrows: dict[str, set[str]] = {}
    for path in _files(*PRODUCT):
        room = _room(".".join(path.relative_to(ROOT).with_suffix("").parts))
        for node in ast.walk(ast.parse(path.read_bytes())):
            if not isinstance(node, ast.ImportFrom) or node.module is None:
                continue
            if node.module.partition(".")[0] not in PRODUCT:
                continue
            named = {_room(f"{node.module}.{alias.name}") for alias in node.names}
            arrows.setdefault(room, set()).update(named - {room})
    return arrows


def test_no_room_is_above_and_below_another() -> None:
    """Folders are floors: whoever names a room is named by nothing in it, nor by what it names."""
    order = TopologicalSorter(_arrows())
    order.prepare()  # Raises CycleError, which says what the circle is.
    assert order.is_active()


def test_a_class_name_has_one_meaning() -> None:
    """Who reads `Link` somewhere knows which one it is."""
    homes: dict[str, list[str]] = {}
    for path in _files(*PRODUCT):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(_name(path))
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}


def _top_level_folders() -> Iterator[str]:
    """Of the files under version control; of those that lie here where there is none."""
    listing = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listing.returncode == 0 and listing.stdout:
        yield from (file.partition("/")[0] for file in listing.stdout.split("\0") if "/" in file)
        return
    for path in ROOT.iterdir():
        hidden = path.name.startswith(".") and path.name not in FOLDERS
        scratch = path.name in SCRATCH or path.suffix == ".egg-info"
        if path.is_dir() and not hidden and not scratch:
            yield path.name


def test_the_top_level_is_fixed() -> None:
    assert set(_top_level_folders()) <= FOLDERS
    assert set(PRODUCT) <= set(_top_level_folders())
