import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from subprocess import run as run_process

import numpy as np
import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.drawing import POSES, evenly_apart, spans
from deploy.outcome.figures import _frame, _motion, comparison, panels
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load

pytestmark = pytest.mark.slow

ENDINGS = ("svg", "png", "pdf")


def run(*overrides: str) -> Trajectory:
    scenario = load("paper", ["run.duration_s=0.5", *overrides])
    return trajectory(scenario, *run_twin(scenario))


@pytest.fixture(scope="module")
def distributed() -> Trajectory:
    return run()


def test_panels_are_the_same_to_the_byte(distributed: Trajectory, tmp_path: Path) -> None:
    first, again = panels(distributed, tmp_path / "a"), panels(distributed, tmp_path / "b")
    assert [path.name for path in first] == [f"a.{ending}" for ending in ENDINGS]
    for path, other in zip(first, again, strict=True):
        assert path.read_bytes() == other.read_bytes()
    assert b"<dc:date>" not in first[0].read_bytes()
    assert b"CreationDate" not in first[2].read_bytes()


def test_both_controllers_fit_into_one_picture(distributed: Trajectory, tmp_path: Path) -> None:
    original = run("election.enabled=false")
    paths = comparison(original, distributed, tmp_path / "both.of.them")
    assert [path.name for path in paths] == [f"both.of.them.{ending}" for ending in ENDINGS]
    assert all(path.stat().st_size > 10_000 for path in paths)


def test_limits_hold_every_motion_with_equal_scales(distributed: Trajectory) -> None:
    far = replace(distributed, angles_rad=3.0 * distributed.angles_rad)
    motions = [_motion(distributed), _motion(far)]
    frame = _frame(motions)
    for motion in motions:
        for points_m, window in (
            (motion.com_m, frame.com),
            (motion.joints_m.reshape(-1, 2), frame.body),
        ):
            for low_high_m, values_m in zip(window, points_m.T, strict=True):
                assert low_high_m[0] < values_m.min()
                assert values_m.max() < low_high_m[1]


@pytest.mark.parametrize("ticks", [1, 2, 30])
def test_a_run_may_be_short_and_end_in_no_number(
    distributed: Trajectory, tmp_path: Path, ticks: int
) -> None:
    angles_rad = distributed.angles_rad[: ticks + 1].copy()
    angles_rad[-1] = np.nan
    short = replace(
        distributed,
        angles_rad=angles_rad,
        torques_nm=distributed.torques_nm[:ticks],
        enabled=distributed.enabled[:ticks],
    )
    assert panels(short, tmp_path / "short")


def test_many_links_are_drawn(tmp_path: Path) -> None:
    """Nine links, more than there are colours; elections on."""
    links = 9
    boards = "".join(
        f'[[board]]\njoint = "j{i}"\ncontrols = "link-orientation"\ninitial_deg = 2.0\n'
        f"imu = {str(i == links - 1).lower()}\n"
        "[board.servo]\nkp_nm_rad = 100.0\nkd_nm_s_rad = 1.0\n"
        f'[board.link]\nname = "link{i}"\nmass_kg = 2.0\nlength_m = 0.2\ncom_m = 0.1\n'
        for i in range(links)
    )
    path = tmp_path / "nine.toml"
    path.write_text(f"[run]\nduration_s = 0.1\n[election]\nrounds = 8\n{boards}", encoding="utf-8")
    scenario = load(str(path))
    assert panels(trajectory(scenario, *run_twin(scenario)), tmp_path / "nine")


def test_poses_are_evenly_apart_and_hold_both_ends() -> None:
    times_s = np.linspace(0.0, 5.0, 501)
    height_m = np.exp(-3.0 * times_s)
    joints_m = np.zeros((501, 2, 2))
    joints_m[:, 1, 1] = height_m
    poses = evenly_apart(joints_m)
    assert (poses[0], poses[-1]) == (0, 500)
    gaps_m = [height_m[a] - height_m[b] for a, b in pairwise(poses)]
    # A pose is up to one sample, 3 % of what is left of the way, late.
    assert max(gaps_m) <= 1.0 / (POSES - 1) + 0.03


def test_a_body_at_rest_has_poses_too() -> None:
    assert evenly_apart(np.zeros((5, 2, 2))) == [0, 4]
    assert evenly_apart(np.zeros((1, 2, 2))) == [0]


@pytest.mark.parametrize(
    ("true", "expected"),
    [("", []), ("0", []), ("1", [(0, 1)]), ("0110", [(1, 3)]), ("1011", [(0, 1), (2, 4)])],
)
def test_spans_cover_what_is_true(true: str, expected: list[tuple[int, int]]) -> None:
    assert list(spans(np.array([letter == "1" for letter in true], dtype=bool))) == expected


def test_only_the_figures_need_matplotlib_and_never_its_global_state() -> None:
    code = (
        "import sys, deploy.outcome.indices, deploy.outcome.summary, deploy.outcome.table_ii;"
        "assert 'matplotlib' not in sys.modules;"
        "import deploy.outcome.figures; assert 'matplotlib.pyplot' not in sys.modules"
    )
    found = run_process(
        [sys.executable, "-c", code],
        check=False,
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stderr
