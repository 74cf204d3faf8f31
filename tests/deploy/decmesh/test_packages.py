"""A stranger's package in the place of one of ours: every command says so in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands import doctor_checks as look
from deploy.decmesh import packages
from protocol.process.exit_codes import ExitCode

ROOT = Path(packages.__file__).parents[2]
STRANGER = 'print("executed")\nraise RuntimeError("a stranger")\n'


@pytest.fixture
def stranger(tmp_path: Path) -> Path:
    """A folder with a package called `protocol`, as `pip install protocol` leaves one."""
    package = tmp_path / "protocol"
    package.mkdir()
    (package / "__init__.py").write_text(STRANGER, encoding="utf-8")
    return tmp_path


def run(*command: str, first: Path, then: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """Run a module where Python looks into one folder first, as it does for what is installed."""
    return subprocess.run(
        [sys.executable, "-m", *command],
        env=os.environ | {"PYTHONPATH": f"{first}{os.pathsep}{then}"},
        cwd="/",
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    "command",
    [
        ["deploy", "scenarios"],
        ["deploy.decmesh", "doctor"],
        ["plant_server", "--help"],
        ["module_agent", "knee", "--help"],
        ["module_agent.process.elector_runtime", "--help"],
    ],
    ids=lambda command: command[0],
)
def test_a_stranger_is_named_in_one_line_and_never_executed(
    stranger: Path, command: list[str]
) -> None:
    ended = run(*command, first=stranger)
    assert ended.returncode == ExitCode.UNFIT == packages.UNFIT
    assert ended.stdout == ""
    (line,) = ended.stderr.splitlines()
    assert str(stranger / "protocol") in line


def test_the_installed_command_notices_a_stranger_called_deploy(tmp_path: Path) -> None:
    """`decmesh` itself begins in a package whose name is ours alone."""
    (tmp_path / "deploy").mkdir()
    (tmp_path / "deploy" / "__init__.py").write_text(STRANGER, encoding="utf-8")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "decmesh").symlink_to(ROOT / "deploy" / "decmesh")
    ended = run("decmesh", "scenarios", first=tmp_path, then=tmp_path / "ours")
    assert (ended.returncode, ended.stdout) == (ExitCode.UNFIT, "")
    assert len(ended.stderr.splitlines()) == 1


def test_the_doctor_looks_for_strangers(monkeypatch: pytest.MonkeyPatch) -> None:
    assert look.own_packages().verdict == "ok"
    monkeypatch.setattr(packages, "OURS", "a word that stands in no package")
    check = look.own_packages()
    assert check.verdict == "wrong"
    assert "another project's package protocol" in check.found
    assert "environment of its own" in check.do


def test_a_package_that_is_missing_is_called_missing() -> None:
    assert packages.complaint("protocol", "").startswith(
        "the package protocol of decmesh is missing"
    )
