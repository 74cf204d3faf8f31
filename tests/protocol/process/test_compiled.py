"""What is compiled is what is written, or nothing runs."""

import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from protocol.process.compiled import INTERPRETED, PACKAGES, ROOT, changed, compiled
from protocol.process.exit_codes import ExitCode
from protocol.robot import clocks


def test_tests_test_what_is_written() -> None:
    """Also where `make compiled` has left its libraries, which stay where they are."""
    assert clocks.__file__.endswith(".py")


LEFT_OUT = shutil.ignore_patterns("*.pyc", *(f"*{suffix}" for suffix in EXTENSION_SUFFIXES))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in (*PACKAGES, "deploy"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=LEFT_OUT)
    return tmp_path


def _left_beside(source: Path, *, older_s: float) -> Path:
    library = source.with_suffix(EXTENSION_SUFFIXES[0])
    library.touch()
    made = source.stat().st_mtime - older_s
    os.utime(library, (made, made))
    return library


def test_a_source_is_current_until_it_is_changed(copy: Path) -> None:
    body = copy / "plant_server" / "body" / "body.py"
    roster = copy / "plant_server" / "session" / "roster.py"
    fresh, old = _left_beside(body, older_s=-5), _left_beside(roster, older_s=5)
    (copy / "protocol" / f"control_loop__mypyc{EXTENSION_SUFFIXES[0]}").touch()
    assert dict(compiled(copy)) == {body: fresh, roster: old}
    assert changed(copy) == [roster]


@pytest.mark.parametrize(
    "command",
    [["deploy", "scenarios"], ["plant_server", "--help"], ["module_agent", "knee", "--help"]],
    ids=lambda command: command[0],
)
def test_every_process_refuses_what_has_changed_in_one_line(copy: Path, command: list[str]) -> None:
    _left_beside(copy / "plant_server" / "body" / "body.py", older_s=5)
    ended = _run(copy, "-m", *command, interpreted="0")
    assert ended.stdout == ""
    assert ended.stderr == (
        "plant_server/body/body.py has changed since it was compiled; `make compiled` makes its new"
        " form, `make interpreted` does without\n"
    )
    assert ended.returncode == ExitCode.BAD_INPUT


def test_sources_run_beside_what_was_compiled_where_they_are_asked_for(copy: Path) -> None:
    """What lies there would not even load."""
    _left_beside(copy / "protocol" / "robot" / "clocks.py", older_s=5)
    code = "from protocol.robot import clocks; print(clocks.__file__)"
    assert _run(copy, "-c", code, interpreted="1").stdout.endswith("clocks.py\n")
    _left_beside(copy / "protocol" / "robot" / "clocks.py", older_s=-5)
    assert "ImportError" in _run(copy, "-c", code, interpreted="0").stderr


def _run(copy: Path, *command: str, interpreted: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command],
        cwd=copy,
        env=os.environ | {INTERPRETED: interpreted, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
