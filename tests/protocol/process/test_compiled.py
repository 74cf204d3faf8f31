"""What is compiled is what is written, or nothing runs."""

import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from protocol.process.compiled import PACKAGES, ROOT, changed, compiled
from protocol.process.exit_codes import ExitCode


def test_tests_test_what_is_written() -> None:
    """`make test` sees to it; by hand: `make interpreted`."""
    assert list(compiled()) == []


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in (*PACKAGES, "deploy"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("*.pyc"))
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
    ended = subprocess.run(
        [sys.executable, "-m", *command], cwd=copy, capture_output=True, text=True, check=False
    )
    assert ended.stdout == ""
    assert ended.stderr == (
        "plant_server/body/body.py has changed since it was compiled; `make compiled` makes its new"
        " form, `make interpreted` does without\n"
    )
    assert ended.returncode == ExitCode.BAD_INPUT
