"""T_e: which values are run, what is made of the runs, and the command."""

import csv
import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from rich.console import Console

from deploy.experiments.election_period.figure import te_figure
from deploy.experiments.election_period.run import (
    PeriodCase,
    PeriodResult,
    grid,
    in_order,
    measure,
    periods_s,
    write_csv,
)
from deploy.experiments.election_period.table import te_table
from deploy.launch.twin import run_twin
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from deploy.scenario_file.ticks import whole_ticks
from protocol.robot.scenario import ScenarioError

pytestmark = pytest.mark.slow

SHORT = ("run.duration_s=0.3",)
VALUES = (0.02, 0.05, 0.1)


@pytest.fixture(scope="module")
def results() -> list[PeriodResult]:
    return in_order([measure(case) for case in reversed(grid(VALUES, SHORT))])


def shown(results: list[PeriodResult]) -> list[list[str]]:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(te_table(results))
    return [line.split() for line in capture.get().splitlines()]


def test_values_are_read_one_by_one() -> None:
    assert periods_s("0.2, 0.05,0.1,0.1", tick_s=1e-3) == [0.05, 0.1, 0.2]


@pytest.mark.parametrize("tick_s", [1e-4, 1e-3, 5e-3])
def test_a_range_is_filled_with_whole_ticks_about_evenly_on_a_logarithmic_scale(
    tick_s: float,
) -> None:
    found = periods_s("0.02:1.0", tick_s=tick_s)
    assert (found[0], found[-1]) == (0.02, 1.0)
    assert found == sorted(set(found))
    assert all(whole_ticks(value * 1e3, tick_s * 1e3) is not None for value in found)
    ratios = [b / a for a, b in pairwise(found)]
    assert max(ratios) < (1.3 if tick_s < 5e-3 else 1.6)
    assert len(found) > (30 if tick_s < 5e-3 else 20)


@pytest.mark.parametrize("text", ["", "x", "0.1,", "0", "-1", "nan", "inf", "1:0.1", "0.1:", "1:1"])
def test_what_is_no_value_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"write it like 0\.1|from the shorter"):
        periods_s(text, tick_s=1e-3)


def test_every_t_e_that_the_scenario_cannot_have_is_named_before_anything_runs() -> None:
    with pytest.raises(ScenarioError) as caught:
        grid([0.0155, 0.002, 0.1], SHORT)
    lines = str(caught.value).splitlines()
    assert len(lines) == 2
    assert "0.0155 s is not a whole number of ticks" in lines[0]
    assert "2 rounds, one a tick, do not fit into a period of 2 ticks" in lines[1]


def test_a_row_is_a_run_that_can_be_had_again(results: list[PeriodResult]) -> None:
    scenario = load("paper", [*SHORT, "election.period_s=0.05"])
    again = trajectory(scenario, *run_twin(scenario))
    assert [result.period_s for result in results] == [None, *VALUES]
    assert results[2].summary["state_sha256"] == again.state_sha256
    assert [r.summary["controller"] for r in results] == ["original"] + ["distributed"] * 3
    assert [r.summary["consensus"] and r.summary["consensus"]["epochs"] for r in results] == [
        None,
        15,
        6,
        3,
    ]


def test_the_file_has_a_line_for_each_run(results: list[PeriodResult], tmp_path: Path) -> None:
    write_csv(results, tmp_path / "te.csv")
    with (tmp_path / "te.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["period_s"] for line in lines] == ["", "0.02", "0.05", "0.1"]
    for line, result in zip(lines, results, strict=True):
        indices = result.summary["indices"]["TS"]
        assert float(line["TS_overshoot_deg"]) == indices["overshoot_deg"]
        assert float(line["energy_positive_j"]) == result.summary["energy_j"]["positive"]
        assert line["state_sha256"] == result.summary["state_sha256"]


def test_the_table_fits_a_terminal(results: list[PeriodResult]) -> None:
    lines = [line for line in shown(results) if line and line[0] in ("none", "0.02", "0.05", "0.1")]
    assert len(lines) == 4
    for line, result in zip(lines, results, strict=True):
        assert line[1] == f"{result.summary['indices']['TS']['overshoot_deg']:.2f}"
        assert line[-1] == f"{result.summary['energy_j']['positive']:.2f}"


def test_a_fall_is_marked_and_its_numbers_are_not_shown(
    results: list[PeriodResult], tmp_path: Path
) -> None:
    fell = [*results[:-1], PeriodResult(0.1, {**results[-1].summary, "ending": "fell"})]
    last = next(line for line in shown(fell) if line and line[0] == "0.1")
    assert last == ["0.1", *["-"] * 10, "fell"]
    standing, _ = te_figure(results, 0.1, tmp_path / "a")
    fallen, _ = te_figure(fell, 0.1, tmp_path / "b")
    assert standing.read_bytes() != fallen.read_bytes()


def test_only_falls_can_be_drawn(results: list[PeriodResult], tmp_path: Path) -> None:
    fell = [PeriodResult(r.period_s, {**r.summary, "ending": "fell"}) for r in results]
    assert te_figure(fell, 0.1, tmp_path / "fell")


def test_the_figure_is_the_same_for_the_same_results(
    results: list[PeriodResult], tmp_path: Path
) -> None:
    paths = [te_figure(results, 0.1, tmp_path / name) for name in ("a", "b")]
    assert [path.name for path in paths[0]] == ["a.svg", "a.png"]
    for one, other in zip(*paths, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_a_real_fall_is_a_result() -> None:
    settings = ("run.duration_s=3", "board.0.servo.kp_nm_rad=0")
    assert measure(PeriodCase(0.1, settings)).summary["ending"] == "fell"


def te(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "deploy", "measure", "te", *arguments, "--set", SHORT[0]],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_the_command_leaves_table_file_and_figure(tmp_path: Path) -> None:
    done = te("--values", "0.05,0.1", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert done.stdout.splitlines()[-3:] == [
        str(tmp_path / name) for name in ("te.csv", "te.svg", "te.png")
    ]


def test_json_has_the_same_facts_and_is_all_there_is(
    results: list[PeriodResult], tmp_path: Path
) -> None:
    done = te("--values", "0.05", "--out", str(tmp_path), "--json")
    told = json.loads(done.stdout)
    assert told["complete"] is True
    assert [run["period_s"] for run in told["runs"]] == [None, 0.05]
    assert told["runs"][1]["state_sha256"] == results[2].summary["state_sha256"]


def test_a_slip_is_one_line(tmp_path: Path) -> None:
    for values in ("0.1:0.05", "x", "0.0155"):
        done = te("--values", values, "--out", str(tmp_path / "none"))
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1
        assert not (tmp_path / "none").exists()
