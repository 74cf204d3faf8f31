import json
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.summary import summary, write_summary
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load

KEYS = {
    "scenario", "seed", "mode", "controller", "ending", "ticks", "simulated_s", "wall_s",
    "ticks_per_s", "state_sha256", "logical_sha256", "indices", "energy_j", "consensus", "realtime",
    "faults", "degraded", "foot", "versions",
}  # fmt: skip


@pytest.fixture(scope="module")
def second() -> Trajectory:
    return run()


def run(*overrides: str) -> Trajectory:
    scenario = load("paper", ["run.duration_s=1", "run.seed=7", *overrides])
    return trajectory(scenario, *run_twin(scenario))


def test_it_says_what_was_run_and_what_came_out(second: Trajectory) -> None:
    found = summary(second, mode="twin", logical_sha256="4711")
    assert set(found) == KEYS
    assert (found["scenario"], found["seed"], found["mode"]) == ("paper", 7, "twin")
    assert (found["controller"], found["ending"]) == ("distributed", "complete")
    assert (found["ticks"], found["simulated_s"]) == (1000, 1.0)
    assert (found["state_sha256"], found["logical_sha256"]) == (second.state_sha256, "4711")
    assert set(found["indices"]) == {"TS", "KNEE", "BS"}
    assert set(found["energy_j"]) == {"positive", "absolute", "net"}
    assert found["consensus"]["epochs"] == 10
    assert found["faults"] == found["degraded"] == []
    assert found["foot"] is None
    assert None not in found["versions"].values()


def test_a_torque_that_is_no_number_degrades_a_run(second: Trajectory) -> None:
    """It is said of the run afterwards, not only counted while it goes on."""
    asked_nm = second.asked_nm.copy()
    asked_nm[300:340:2, 1] = nan
    asked_nm[7, 2] = inf
    found = summary(replace(second, asked_nm=asked_nm), mode="processes")
    assert found["degraded"] == [
        {"joint": "knee", "tick": 300, "ticks": 20},
        {"joint": "hip", "tick": 7, "ticks": 1},
    ]


def test_without_elections_it_is_the_original_controller() -> None:
    found = summary(run("election.enabled=false"), mode="processes")
    assert (found["controller"], found["consensus"]) == ("original", None)


def test_two_runs_differ_in_their_wall_time_only(second: Trajectory) -> None:
    wall = {"wall_s": None, "ticks_per_s": None}
    assert {**summary(run(), mode="twin"), **wall} == {**summary(second, mode="twin"), **wall}


@pytest.mark.parametrize("wall_s", [0.0, nan, inf])
def test_what_is_no_number_is_null(second: Trajectory, wall_s: float) -> None:
    found = summary(replace(second, wall_s=wall_s), mode="twin")
    assert found["ticks_per_s"] in (None, 0.0)
    assert parsed(json.dumps(found, allow_nan=False)) == found


def test_a_written_summary_reads_back(second: Trajectory, tmp_path: Path) -> None:
    path, values = tmp_path / "summary.json", summary(second, mode="twin")
    write_summary(path, {"old": True})
    write_summary(path, values)
    assert parsed(path.read_text(encoding="utf-8")) == values
    assert list(tmp_path.iterdir()) == [path]


def test_a_summary_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    write_summary(path, {"old": True})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_summary(path, {"wall_s": nan})
    path.with_name("folder").mkdir()
    with pytest.raises(OSError, match="directory"):
        write_summary(path.with_name("folder"), {"new": True})
    assert parsed(path.read_text(encoding="utf-8")) == {"old": True}
    assert sorted(found.name for found in tmp_path.iterdir()) == ["folder", "summary.json"]


def parsed(text: str) -> Any:
    return json.loads(text)
