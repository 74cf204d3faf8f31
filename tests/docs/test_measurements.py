"""The numbers in the chapter on measurements are those that a run gives today."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.summary import Summary, summary
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from tests.docs.documents import CHAPTERS, ROOT, blocks, section, text_of

pytestmark = pytest.mark.slow

CHAPTER = CHAPTERS / "measurements.md"
COLUMNS = 6
INDICES = ("overshoot_deg", "rise_s", "rise_90_s", "settling_paper_s", "settling_band_s")


def result(*settings: str) -> Summary:
    scenario = load("paper", list(settings))
    return summary(trajectory(scenario, *run_twin(scenario)), mode="twin")


def cells(run: Summary) -> list[str]:
    """What the table says of a run, from top to bottom."""
    found = []
    for variable in ("TS", "KNEE", "BS"):
        for key in INDICES:
            value, unit = run["indices"][variable][key], "°" if key == "overshoot_deg" else " s"
            digits = 4 if key == "overshoot_deg" else 2
            found.append("never" if value is None else f"{value:.{digits}f}{unit}")
    energy = run["energy_j"]
    return [*found, *(f"{abs(energy[key]):.2f} J" for key in ("positive", "absolute", "net"))]


def table_ii() -> list[tuple[str, str]]:
    """Our columns of the table, original and distributed, without marks."""
    lines = section(CHAPTER, "The paper's table II").splitlines()
    rows = [re.split(r"(?<!\\)\|", line) for line in lines if line.startswith("|")]
    return [(row[4].strip(" ✓"), row[6].strip(" ✓")) for row in rows[2:] if len(row) == COLUMNS + 2]


def test_table_ii_is_todays() -> None:
    distributed = result()
    ours = zip(cells(result("election.enabled=false")), cells(distributed), strict=True)
    assert table_ii() == list(ours)
    assert distributed["consensus"]["rounds_to_agreement"] == {"1": 4, "2": 96, "never": 0}
    assert distributed["consensus"]["enabled_1"] == 100


@pytest.mark.parametrize(("elects", "energy_j"), [("false", "18.7"), ("true", "108")])
def test_less_inertia_costs_the_distributed_controller_more(elects: str, energy_j: str) -> None:
    """By the command that stands in the chapter beside these numbers."""
    text = " ".join(text_of(CHAPTER).split())
    assert f"{energy_j} J in the" in text
    command = re.search(r"`decmesh run paper --twin ([^`]+)`", text)
    assert command is not None
    settings = re.findall(r"--set (\S+)", command[1])
    run = result(*settings, f"election.enabled={elects}")
    assert f"{run['energy_j']['positive']:.3g}" == energy_j


def test_what_the_chapter_computes_is_what_it_prints(tmp_path: Path) -> None:
    found = blocks(CHAPTER)
    (code,) = (block.text for block in found if block.kind == "python")
    (shown,) = (block.text for block in found if block.kind == "text")
    ran = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout == shown
