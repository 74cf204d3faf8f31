"""The command line teaches, and a program can use it."""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from deploy.cli import app
from deploy.scenario_file.load import available
from protocol.process.exit_codes import ExitCode

pytestmark = pytest.mark.slow

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


def commands(group: typer.Typer, prefix: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command, those in groups included."""
    for command in group.registered_commands:
        assert command.callback is not None
        yield (*prefix, command.name or command.callback.__name__)
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        assert inner.name is not None
        yield from commands(inner.typer_instance, (*prefix, inner.name))


COMMANDS = list(commands(app))
WIDTH = 76
"""Of a line in a terminal of 80 columns, margins taken off."""


def shown(*words: str) -> str:
    """The help of a command, as a program gets it."""
    found = CliRunner().invoke(app, [*words, "--help"], prog_name="decmesh")
    assert found.exit_code == ExitCode.OK
    return found.output


def test_the_guide_says_what_it_is_what_to_do_first_and_what_there_is() -> None:
    guide = decmesh("--help").stdout
    first = [guide.index(f"decmesh {word}") for word in ("doctor", "paper", "run blackout")]
    assert first == sorted(first)
    panels = ("Run", "Scenarios", "On a running robot", "Measure")
    assert all(f"─ {panel} ─" in guide for panel in panels)
    assert "─ Commands ─" not in guide, "every command is in a group with a name"
    for words in COMMANDS:
        assert f"│ {words[0]} " in guide
    assert "\x1b" not in guide


def test_without_a_word_it_shows_the_guide() -> None:
    done = decmesh()
    assert done.stdout.strip() == decmesh("--help").stdout.strip()
    assert done.stderr == ""


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_explains_itself_with_an_example_that_can_be_typed(
    words: tuple[str, ...],
) -> None:
    """The example is parsed as a command line, though not run."""
    command = f"decmesh {' '.join(words)}"
    (example,) = re.findall(r"Example: (decmesh .*)", shown(*words))
    assert example.startswith(command)
    context = typer.main.get_command(app).make_context("decmesh", shlex.split(example)[1:])
    arguments = [*context._protected_args, *context.args]
    assert arguments[0] == words[0]
    here: Any = context.command
    for _ in words:
        name, here, arguments = here.resolve_command(context, arguments)
        context = here.make_context(name, arguments, parent=context)
        arguments = [*context._protected_args, *context.args]
    assert context.command_path == command


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_what_a_command_says_of_itself_fits_a_terminal(words: tuple[str, ...]) -> None:
    lines = shown(*words).splitlines()
    text = [line for line in lines if line.startswith(" ") and "Usage:" not in line]
    assert all(len(line.rstrip()) <= WIDTH + 1 for line in text)


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_has_its_facts_for_programs(words: tuple[str, ...]) -> None:
    assert "--json" in shown(*words)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["walk"], "decmesh: No such command 'walk'; see decmesh --help"),
        (["run"], "decmesh run: Missing argument 'scenario'; see decmesh run --help"),
        (["run", "paper", "--twins"], "decmesh run: No such option: --twins"),
        (["run", "papr"], "papr: no such scenario; did you mean 'paper'?"),
        (["run", "paper", "--patience", "5"], "write it like 200ms or 1.5s"),
        (["check", "paper", "--set", "run.secs=1"], "run.secs: unknown key"),
        (["check", "none.toml"], "none.toml: no such file"),
        (["push", "40"], "decmesh push: Invalid value: '40' is no force; write it like 5N"),
        (["loss", "2"], "less than or equal to 1; see decmesh loss --help"),
        (["study", "loss", "--duration", "5"], "decmesh study loss: Invalid value: '5' is no time"),
    ],
)
def test_a_slip_gets_exit_code_2_and_one_line_that_says_what_to_do(
    arguments: list[str], line: str
) -> None:
    done = decmesh(*arguments)
    assert done.returncode == ExitCode.BAD_INPUT
    assert line in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not done.stdout


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


def test_the_paper_for_programs_is_both_summaries_and_the_files(tmp_path: Path) -> None:
    done = decmesh("paper", *SHORT, "--json", "--out", str(tmp_path / "paper"))
    told = json.loads(done.stdout)
    assert done.stderr == ""
    for controller in ("original", "distributed"):
        summary = json.loads((tmp_path / "paper" / controller / "summary.json").read_text())
        assert told[controller] == summary
    assert len(told["files"]) == 9
    assert all(Path(file).is_file() for file in told["files"])


def test_scenarios_are_listed_with_what_they_show() -> None:
    done = decmesh("scenarios")
    assert done.returncode == ExitCode.OK
    told = json.loads(decmesh("scenarios", "--json").stdout)
    assert sorted(told) == available()
    listed = " ".join(done.stdout.split())
    assert all(f"{name} {description}" in listed for name, description in told.items())


def test_a_checked_scenario_can_be_had_in_full() -> None:
    assert decmesh("check", "paper").stdout.startswith("paper: fine; boards ankle, knee, hip; ")
    resolved = json.loads(decmesh("check", "paper", "--resolved").stdout)
    assert resolved["run"]["ticks"] == 10_000
    assert resolved["board"][2]["joint"] == "hip"
    told = json.loads(decmesh("check", "paper", "--json").stdout)
    assert (told["fine"], told["boards"]) == (True, ["ankle", "knee", "hip"])
    assert told["mistakes"] == []


def test_mistakes_are_the_same_for_programs() -> None:
    wrong = ("check", "paper", "--set", "run.secs=1", "--set", "election.rounds=0")
    done, told = decmesh(*wrong), decmesh(*wrong, "--json")
    assert done.returncode == told.returncode == ExitCode.BAD_INPUT
    assert json.loads(told.stdout)["mistakes"] == done.stderr.splitlines()
    assert json.loads(told.stdout)["fine"] is False
    assert told.stderr == ""
    assert len(done.stderr.splitlines()) == 2


def test_a_folder_with_results_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("mine")
    done = decmesh("run", "paper", *SHORT, "--out", str(tmp_path))
    assert done.returncode == ExitCode.NO_OUTPUT
    assert done.stderr == f"{tmp_path} is not empty; choose another folder with --out\n"
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_a_run_of_one_tick_in_a_folder_with_brackets_is_a_run_as_any_other(tmp_path: Path) -> None:
    folder = tmp_path / "one [red]tick"
    words = ("paper", "--twin", "--set", "run.duration_s=0.001", "--out", str(folder))
    done = decmesh("run", *words)
    assert done.returncode == ExitCode.OK, done.stderr
    files = [str(folder / name) for name in ("summary.json", "run.mcap")]
    assert done.stdout.splitlines()[-2:] == files
    assert decmesh("replay", str(folder)).stdout == "identical: 1 ticks\n"
