"""The loss study: a grid of twins, summed up; what is done is kept."""

import csv
import subprocess
import sys
from math import isclose
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from deploy.experiments.consensus.theory import several_enabled
from deploy.experiments.loss import (
    LossCase,
    LossResult,
    Mean,
    grid,
    means,
    measure,
    write_csv,
)
from deploy.experiments.loss_figure import loss_figure
from deploy.experiments.loss_table import loss_table
from deploy.launch.workers import work_off
from protocol.process.stopping import StoppedError
from protocol.robot.scenario import ScenarioError

pytestmark = pytest.mark.slow

SMALL = grid(seeds=2, duration_s=0.3, losses=(0.0, 0.5), rounds=(2, 8))


@pytest.fixture(scope="module")
def results() -> list[LossResult]:
    found, complete = work_off(measure, SMALL, lambda _result: None)
    assert complete
    return found


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def shown(found: list[Mean]) -> list[list[str]]:
    """The lines of the table, loss included where it is not repeated."""
    console = Console(width=80)
    with console.capture() as capture:
        console.print(loss_table(found))
    lines = [line.split() for line in capture.get().splitlines()]
    return [line for line in lines if line and line[-1].count("/") == 1]


def test_the_grid_is_every_seed_of_every_loss_and_r() -> None:
    assert len(SMALL) == len(set(SMALL)) == 8
    assert len(grid(seeds=5, duration_s=10.0)) == 5 * 7 * 4


def test_a_study_of_an_impossible_scenario_is_refused_before_it_begins() -> None:
    with pytest.raises(ScenarioError, match=r"run\.duration_s"):
        grid(seeds=1, duration_s=0.01234)


def test_it_is_the_same_on_any_number_of_cores(results: list[LossResult], tmp_path: Path) -> None:
    alone = [measure(case) for case in SMALL]
    write_csv(alone, tmp_path / "alone.csv")
    write_csv(results, tmp_path / "together.csv")
    assert (tmp_path / "alone.csv").read_bytes() == (tmp_path / "together.csv").read_bytes()


def test_the_file_has_a_row_for_each_run_in_the_order_of_the_grid(
    results: list[LossResult], tmp_path: Path
) -> None:
    write_csv(results, tmp_path / "loss.csv")
    found = rows(tmp_path / "loss.csv")
    cases = [(float(row["loss"]), int(row["rounds"]), int(row["seed"])) for row in found]
    assert cases == sorted((case.loss, case.rounds, case.seed) for case in SMALL)


def test_the_table_has_the_means_of_the_file(results: list[LossResult], tmp_path: Path) -> None:
    write_csv(results, tmp_path / "loss.csv")
    found = rows(tmp_path / "loss.csv")
    table = shown(list(means(results)))
    assert len(table) == 4
    for line, first in zip(table, (0, 2, 4, 6), strict=True):
        runs = found[first : first + 2]
        epochs = sum(int(row["epochs"]) for row in runs)
        several = sum(int(row["several_enabled"]) for row in runs) / epochs
        agreed = sum(int(row["agreed"]) for row in runs) / epochs
        astray_deg = sum(float(row["astray_deg"]) for row in runs) / 2
        held = sum(float(row["holding"]) for row in runs) / 2
        assert line[-10:-7] == [runs[0]["rounds"], f"{several:.1%}", f"{agreed:.1%}"]
        assert f"{astray_deg:.3f}°" in line
        assert f"{held:.1%}" in line
        assert line[-1] == "0/2"


def test_without_loss_nothing_is_astray_and_everybody_agrees(results: list[LossResult]) -> None:
    for result in results:
        if result.loss == 0.0:
            assert result.agreed == result.epochs > 0
            assert result.several_enabled == 0
            assert result.astray_deg == 0.0
            assert result.holding == result.extrapolating == result.reckoning == 0.0


def test_a_run_that_ends_before_it_stands_has_no_figure_for_it(results: list[LossResult]) -> None:
    assert all(result.standing_deg is None for result in results)
    standing_deg = measure(LossCase(0.0, 2, 1, 2.5)).standing_deg
    assert standing_deg is not None
    assert 0.0 < standing_deg < 5.0


def test_what_is_done_when_it_is_stopped_is_kept(tmp_path: Path) -> None:
    done = 0

    def stop_after_two(_result: LossResult) -> None:
        nonlocal done
        done += 1
        if done == 2:
            raise StoppedError

    found, complete = work_off(measure, SMALL, stop_after_two)
    assert not complete
    assert len(found) == 2
    write_csv(found, tmp_path / "loss.csv")
    assert len(rows(tmp_path / "loss.csv")) == 2
    assert sum(row.runs for row in means(found)) == 2
    assert loss_figure(list(means(found)), tmp_path / "loss")


def test_the_figure_is_the_same_for_the_same_results(
    results: list[LossResult], tmp_path: Path
) -> None:
    for name in ("a", "b"):
        assert [path.name for path in loss_figure(list(means(results)), tmp_path / name)] == [
            f"{name}.svg",
            f"{name}.png",
        ]
    for ending in ("svg", "png"):
        drawn = (tmp_path / f"a.{ending}").read_bytes()
        assert drawn == (tmp_path / f"b.{ending}").read_bytes()


def test_a_fall_is_counted_and_drawn(results: list[LossResult], tmp_path: Path) -> None:
    fallen = [result._replace(ending="fell") for result in results]
    table = shown(list(means(fallen)))
    assert {line[-1] for line in table} == {"2/2"}
    drawn = [
        loss_figure(list(means(r)), tmp_path / n)[0] for r, n in ((fallen, "x"), (results, "y"))
    ]
    assert drawn[0].read_bytes() != drawn[1].read_bytes()


def test_the_command_leaves_table_file_and_figure(tmp_path: Path) -> None:
    arguments = ("study", "loss", "--seeds", "1", "--duration", "0.1s", "--out", str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "deploy", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert {path.name for path in tmp_path.iterdir()} == {"loss.csv", "loss.svg", "loss.png"}
    assert len(rows(tmp_path / "loss.csv")) == 7 * 4
    assert done.stdout.count("0/1") == 7 * 4
    assert done.stdout.splitlines()[-1] == str(tmp_path / "loss.png")


@pytest.mark.parametrize(
    ("success", "middle", "ends"), [(0.9, 0.0199, 0.19), (0.8, 0.0784, 0.36), (0.5, 0.4375, 0.75)]
)
def test_the_closed_forms_are_those_of_the_theory(
    success: float, middle: float, ends: float
) -> None:
    loss = np.array([1.0 - success])
    assert isclose(several_enabled(loss, ends=False)[0], middle, abs_tol=1e-12)
    assert isclose(several_enabled(loss, ends=True)[0], ends, abs_tol=1e-12)
