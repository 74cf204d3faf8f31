"""The doctor: every look says what it found, and what is not right comes with what to do."""

import json
import os
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
from rich.console import Console

from deploy.commands import doctor
from deploy.commands import doctor_checks as look
from deploy.commands.doctor_checks import Check
from deploy.launch import rigs
from deploy.scenario_file.load import load
from protocol.process.compiled import INTERPRETED, PACKAGES
from protocol.process.exit_codes import ExitCode

FINE = Check("cores", "ok", "2")
MIND = Check("ports", "mind", "17700 is taken", "take another")
WRONG = Check("numpy", "wrong", "not installed", "pip install 'numpy>=2.0'")


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A runtime folder of the test's own."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "decmesh"


def written(checks: list[Check]) -> str:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(doctor.report(checks))
    return capture.get()


def test_it_asks_for_what_the_project_asks_for() -> None:
    wanted = look.needs()
    assert wanted.python == "3.11"
    assert wanted.packages["eclipse-zenoh"] == "1.10.2"
    assert set(wanted.packages) >= {"msgpack", "numpy", "scipy", "matplotlib", "pydantic", "typer"}
    assert "pytest" not in wanted.packages


def test_installed_it_knows_the_same_from_its_metadata(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(look, "ROOT", tmp_path)
    wanted = look.needs()
    assert wanted.python == "3.11"
    assert wanted.packages["eclipse-zenoh"] == "1.10.2"
    assert "pytest" not in wanted.packages


@pytest.mark.parametrize(
    ("found", "wanted", "verdict"),
    [
        ("1.10.2", "1.10.2", "ok"),
        ("1.11.0", "1.10.2", "ok"),
        ("2.0rc1", "1.10.2", "ok"),
        ("1.9.9", "1.10.2", "wrong"),
        ("1.10", "1.10.2", "wrong"),
    ],
)
def test_versions_are_compared_as_numbers(found: str, wanted: str, verdict: str) -> None:
    check = look.package("zenoh", wanted, lambda _name: found)
    assert check.verdict == verdict
    assert look.python(wanted, found).verdict == verdict
    if verdict == "wrong":
        assert check.found == f"{found}, needs {wanted}"
        assert check.do == f"pip install 'zenoh>={wanted}'"


def test_a_missing_package_comes_with_how_to_install_it() -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    check = look.package("numpy", "2.0", missing)
    assert check == WRONG
    assert look.package("msgpack", "1.0").found == version("msgpack")


def test_a_compiled_control_loop_is_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert look.control_loop().found.startswith("interpreted")
    for package in PACKAGES:
        (tmp_path / package).mkdir()
    (tmp_path / "plant_server" / "body.py").touch()
    (tmp_path / "plant_server" / f"body{EXTENSION_SUFFIXES[0]}").touch()
    assert look.control_loop(tmp_path).found == f"interpreted, as {INTERPRETED} asks for"
    monkeypatch.setenv(INTERPRETED, "0")
    assert look.control_loop(tmp_path).found == "compiled"


def test_what_only_slows_a_robot_down_is_no_fault() -> None:
    assert [look.cores(n).verdict for n in (1, 2, 64)] == ["mind", "ok", "ok"]
    assert [look.memory(mb).verdict for mb in (100_000, 50)] == ["ok", "mind"]
    assert look.ports(17_700, 17_700, 4) == Check("ports", "ok", "17700 to 17703 are free")
    moved = look.ports(17_700, 17_732, 4)
    assert moved.verdict == "mind"
    assert "17732 to 17735" in moved.found
    assert "rig.base_port=17732" in moved.do


def test_a_folder_that_is_not_there_yet_can_be_made_where_one_can_write(tmp_path: Path) -> None:
    assert look.folder("run folder", tmp_path / "runs" / "deep", "?").verdict == "ok"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.getuid() == 0, reason="root can write anywhere")
def test_a_folder_of_somebody_else_is_wrong(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    check = look.folder("run folder", tmp_path / "runs", "choose another")
    assert (check.verdict, check.do) == ("wrong", "choose another")


def test_a_folder_that_is_a_file_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("")
    assert look.folder("run folder", tmp_path / "runs" / "mine", "choose another") == Check(
        "run folder", "wrong", f"{tmp_path / 'runs' / 'mine'}: Not a directory", "choose another"
    )


def test_a_rig_file_is_left_over_when_nobody_holds_it(tmp_path: Path, runtime_folder: Path) -> None:
    assert look.rig_files().verdict == "ok"
    with rigs.claim(load("paper", ["rig.base_port=40000"]), tmp_path):
        assert look.rig_files().found == "none is left over; robots running: 1"
    left = runtime_folder / "40000.json"
    left.write_text("{}")
    check = look.rig_files()
    assert check.verdict == "mind"
    assert str(left) in check.do


def test_zenoh_that_does_not_work_is_told_in_its_own_words() -> None:
    check = look.zenoh("no.such.host.invalid", 17_700)
    assert check.verdict == "wrong"
    assert check.found
    assert "Traceback" not in check.found
    assert check.do


def test_the_worst_decides() -> None:
    assert doctor.fit([FINE, MIND])
    assert not doctor.fit([FINE, MIND, WRONG])
    assert "All is well" in written([FINE])
    assert "bear in mind" in written([FINE, MIND])
    assert "Not fit" in written([FINE, MIND, WRONG])
    for check in (MIND, WRONG):
        assert f"do: {check.do}" in written([FINE, MIND, WRONG])


def run_doctor(*options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "deploy", "doctor", *options],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_where_the_tests_run_a_robot_can_too() -> None:
    """Zenoh end to end included; and JSON has the same facts."""
    done = run_doctor("--json")
    assert done.stderr == ""
    told = json.loads(done.stdout)
    assert told["fit"] is True
    assert done.returncode == ExitCode.OK
    looked = {check["about"] for check in told["checks"]}
    packages = set(look.needs().packages)
    assert looked == packages | {
        "Python",
        "control loop",
        "own packages",
        "cores",
        "memory",
        "loopback",
        "clock",
        "run folder",
        "rig folder",
        "rig files",
        "processes",
        "ports",
        "Zenoh",
    }
    assert all((check["do"] == "") == (check["verdict"] == "ok") for check in told["checks"])


def test_what_is_wrong_has_an_exit_code_of_its_own(tmp_path: Path) -> None:
    """A runtime folder that cannot be: a file is in its place."""
    (tmp_path / "decmesh").write_text("")
    done = run_doctor()
    assert done.returncode == ExitCode.UNFIT
    assert "\x1b" not in done.stdout
    assert "wrong  rig folder" in done.stdout
    assert "do: set XDG_RUNTIME_DIR" in done.stdout
    assert done.stderr == ""


def test_without_its_packages_it_says_so_in_one_line(tmp_path: Path) -> None:
    """No traceback, also where not even the command line can be read."""
    (tmp_path / "pydantic.py").write_text("raise ModuleNotFoundError(name='pydantic')")
    done = subprocess.run(
        [sys.executable, "-m", "deploy", "doctor"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
    )
    assert done.returncode == ExitCode.UNFIT
    assert done.stderr == "pydantic is not installed; make run installs what decmesh needs\n"
