"""Processes over Zenoh and the twin: the same trajectory, to the bit (S19, S20)."""

import json
import multiprocessing
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.results import read_run
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from tests.system.rig import Rig, decmesh, eventually, said, twin_digest


def burn() -> None:
    while True:
        pass


@pytest.mark.parametrize("elects", ["true", "false"])
def test_processes_equal_the_twin_to_the_bit(tmp_path: Path, elects: str) -> None:
    settings = ("run.duration_s=0.6", f"election.enabled={elects}")
    options = [word for setting in settings for word in ("--set", setting)]
    done = decmesh("run", "paper", *options, "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["mode"] == "processes"
    assert summary["ticks"] == 600
    assert summary["state_sha256"] == twin_digest(*settings)


def test_a_loaded_machine_changes_nothing(tmp_path: Path) -> None:
    """Whoever is slow is waited for; time decides nothing."""
    hogs = [multiprocessing.get_context("spawn").Process(target=burn) for _ in range(2)]
    for hog in hogs:
        hog.start()
    try:
        settings = ("run.duration_s=0.3",)
        done = decmesh("run", "paper", "--set", *settings, "--out", str(tmp_path / "run"))
    finally:
        for hog in hogs:
            hog.kill()
            hog.join()
    assert done.returncode == 0, done.stderr
    run = read_run(tmp_path / "run")
    assert run is not None
    assert run.state_sha256 == twin_digest(*settings)


def test_started_by_hand_in_an_odd_order(make_rig: Callable[..., Rig], tmp_path: Path) -> None:
    """The hip long before the others, the plant in the middle: each says what it waits for."""
    rig = make_rig("run.duration_s=0.2")
    hip = rig.board("hip")
    eventually(lambda: "hip: waiting for the plant of rig 'robot' at tcp/127.0.0.1:" in said(hip))
    plant = rig.plant("--spool", str(tmp_path / "run.spool"))
    eventually(lambda: "plant: waiting for ankle, knee" in said(plant))
    eventually(lambda: "hip: enrolled; waiting for knee" in said(hip))
    ankle = rig.board("ankle")
    knee = rig.board("knee")
    assert [process.wait(30) for process in (plant, ankle, knee, hip)] == [0, 0, 0, 0]
    run = read_run(tmp_path)
    assert run is not None
    assert run.state_sha256 == twin_digest("run.duration_s=0.2")


def test_five_links_are_a_robot_as_well(tmp_path: Path) -> None:
    """Nothing knows that the paper's body has three."""
    entries = []
    for i in range(5):
        top = "imu = true" if i == 4 else ""
        entries.append(
            f'[[board]]\njoint = "j{i}"\ncontrols = "joint-angle"\ninitial_deg = {3 - i}\n{top}\n'
            f"lumped_delay_ms = 4\n"
            f"[board.servo]\nkp_nm_rad = 60\nkd_nm_s_rad = 1\ngravity_weight = 0.5\n"
            f'[board.link]\nname = "l{i}"\nmass_kg = 4\nlength_m = 0.2\ncom_m = 0.1\n'
        )
    file = tmp_path / "five.toml"
    file.write_text("[run]\nduration_s = 0.2\n[election]\nrounds = 4\n" + "\n".join(entries))
    done = decmesh("run", str(file), "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    scenario = load(str(file))
    twin = trajectory(scenario, *run_twin(scenario))
    assert summary["state_sha256"] == twin.state_sha256
