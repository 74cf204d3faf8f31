"""The command line teaches, and a program can use it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from protocol.exit_codes import ExitCode

COMMANDS = ("paper", "run", "scenarios", "check")
SHORT = ("--twin", "--set", "run.duration_s=0.05")


def decmesh(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run it with both streams piped, as a program would."""
    return subprocess.run(
        [sys.executable, "-m", "deploy", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        cwd=cwd,
        env={**os.environ, "COLUMNS": "100"},
    )


def test_without_a_word_it_shows_what_there_is() -> None:
    done = decmesh()
    shown = done.stdout + done.stderr
    assert all(command in shown for command in COMMANDS)
    assert "Start with: decmesh paper" in shown


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command: str) -> None:
    done = decmesh(command, "--help")
    assert done.returncode == ExitCode.OK
    assert f"Example: decmesh {command}" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["walk"], "No such command 'walk'"),
        (["run"], "Missing argument"),
        (["run", "paper", "--twins"], "--twin"),
        (["run", "papr"], "did you mean 'paper'?"),
        (["check", "paper", "--set", "run.secs=1"], "run.secs: unknown key"),
    ],
)
def test_a_slip_gets_exit_code_2_and_a_hint(arguments: list[str], hint: str) -> None:
    done = decmesh(*arguments)
    assert done.returncode == ExitCode.BAD_INPUT
    assert hint in done.stderr
    assert not done.stdout
    assert "Traceback" not in done.stderr


def test_json_is_all_there_is_on_stdout_and_the_terminal_stays_quiet(tmp_path: Path) -> None:
    done = decmesh("run", "paper", *SHORT, "--json", "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK
    assert done.stderr == ""
    summary = json.loads(done.stdout)
    assert summary == json.loads((tmp_path / "run" / "summary.json").read_text())
    assert (summary["scenario"], summary["mode"], summary["ticks"]) == ("paper", "twin", 50)


def test_a_piped_run_prints_its_table_without_colours_or_bars(tmp_path: Path) -> None:
    done = decmesh("run", "paper", *SHORT, "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert "overshoot" in done.stdout
    files = [str(tmp_path / "run" / name) for name in ("summary.json", "run.mcap")]
    assert done.stdout.splitlines()[-2:] == files


def test_json_also_tells_of_a_fall(tmp_path: Path) -> None:
    fall = ("--set", "board.0.servo.kp_nm_rad=0")
    done = decmesh("run", "paper", "--twin", *fall, "--json", "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.FELL
    assert done.stderr.startswith("fell at ")
    assert json.loads(done.stdout)["ending"] == "fell"


def test_the_seed_is_a_setting(tmp_path: Path) -> None:
    done = decmesh("run", "paper", *SHORT, "--seed", "7", "--json", "--out", str(tmp_path / "run"))
    assert json.loads(done.stdout)["seed"] == 7


def test_results_go_to_a_new_folder_in_runs(tmp_path: Path) -> None:
    done = decmesh("run", "paper", *SHORT, cwd=tmp_path)
    assert done.returncode == ExitCode.OK
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("paper-")
    assert {path.name for path in folder.iterdir()} == {"run.mcap", "summary.json"}


def test_the_paper_is_both_controllers_and_their_pictures(tmp_path: Path) -> None:
    done = decmesh("paper", *SHORT, "--out", str(tmp_path / "paper"))
    assert done.returncode == ExitCode.OK, done.stderr
    assert "Original" in done.stdout
    assert "Distributed" in done.stdout
    for stem in ("original", "distributed", "comparison"):
        for ending in ("png", "pdf", "svg"):
            assert (tmp_path / "paper" / f"{stem}.{ending}").stat().st_size > 10_000
            assert f"{stem}.{ending}" in done.stdout


def test_scenarios_are_listed_with_what_they_show() -> None:
    done = decmesh("scenarios")
    assert done.returncode == ExitCode.OK
    assert "paper" in done.stdout
    assert "The paper's experiment" in done.stdout


def test_a_checked_scenario_can_be_had_in_full() -> None:
    assert decmesh("check", "paper").stdout.startswith("paper: fine; boards ankle, knee, hip; ")
    resolved = json.loads(decmesh("check", "paper", "--resolved").stdout)
    assert resolved["run"]["ticks"] == 10_000
    assert resolved["board"][2]["joint"] == "hip"


def test_a_folder_with_results_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("mine")
    done = decmesh("run", "paper", *SHORT, "--out", str(tmp_path))
    assert done.returncode == ExitCode.NO_OUTPUT
    assert done.stderr == f"{tmp_path} is not empty; choose another folder with --out\n"
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
