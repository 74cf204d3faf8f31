"""What does not fit is refused in one line, with an exit code of its own; nothing is started."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from deploy.scenario_file.load import load
from protocol.process.exit_codes import ExitCode, refused
from protocol.robot.scenario import Scenario, canonical
from protocol.wire.enrolment import EnrolmentVerdict
from protocol.wire.frames import VERSION
from tests.system.rig import Rig, decmesh, eventually, said


def another_file(rig: Rig, scenario: Scenario) -> str:
    """A scenario in a file of its own, beside the rig's."""
    path = rig.folder / f"other{len(list(rig.folder.iterdir()))}.json"
    path.write_bytes(canonical(scenario))
    return str(path)


def test_boards_that_do_not_fit_are_told_why(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig("run.duration_s=0.05")
    plant = rig.plant()
    eventually(lambda: "waiting for" in said(plant))

    other_run = replace(rig.scenario.run, seed=99)
    file = another_file(rig, replace(rig.scenario, run=other_run))
    stranger = rig.start("module_agent", "knee", "--scenario", file)
    assert stranger.wait(30) == refused(EnrolmentVerdict.OTHER_SCENARIO)
    assert "refused: the board was started with scenario" in said(stranger)

    other_rig = replace(rig.scenario.rig, name="another")
    file = another_file(rig, replace(rig.scenario, rig=other_rig))
    stranger = rig.start("module_agent", "knee", "--scenario", file)
    assert stranger.wait(30) == refused(EnrolmentVerdict.WRONG_RIG)
    assert "refused: the board belongs to rig 'another', the plant to rig 'robot'" in said(stranger)

    nobody = rig.board("elbow")
    assert nobody.wait(30) == refused(EnrolmentVerdict.UNKNOWN_JOINT)
    assert said(nobody) == "elbow: unknown joint; the body has ankle, knee, hip\n"

    boards = [rig.board(joint) for joint in rig.scenario.joints]
    assert [process.wait(30) for process in (plant, *boards)] == [0, 0, 0, 0]


OF_ANOTHER_VERSION = """
import sys
import protocol.wire.frames
protocol.wire.frames.VERSION += 1
from module_agent.__main__ import main
sys.exit(main())
"""


def test_a_board_of_another_version_is_told_so(make_rig: Callable[..., Rig]) -> None:
    """Its firmware is ours but for the number."""
    rig = make_rig()
    plant = rig.plant()
    eventually(lambda: "waiting for" in said(plant))
    command = [sys.executable, "-c", OF_ANOTHER_VERSION, "knee", "--scenario", str(rig.file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0)
    assert done.returncode == refused(EnrolmentVerdict.WRONG_VERSION)
    line = f"knee: refused: the board speaks version {VERSION + 1}, the plant version {VERSION}\n"
    assert done.stderr == line


def test_a_joint_has_one_driver(make_rig: Callable[..., Rig]) -> None:
    """The port being taken is a symptom; the plant knows the reason."""
    rig = make_rig()
    plant = rig.plant()
    knee = rig.board("knee")
    eventually(lambda: "waiting for ankle, hip" in said(plant))
    assert knee.poll() is None
    second = rig.board("knee")
    assert second.wait(30) == refused(EnrolmentVerdict.JOINT_TAKEN)
    assert "refused: knee has a board already, boot" in said(second)
    assert knee.poll() is None


def test_a_port_that_is_taken_is_one_line(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    first = rig.plant()
    eventually(lambda: "waiting for" in said(first))
    second = rig.plant()
    assert second.wait(30) == ExitCode.NO_NETWORK
    assert len(said(second).splitlines()) == 1
    assert "is in use" in said(second)


def test_decmesh_finds_other_ports_when_its_own_are_taken(
    make_rig: Callable[..., Rig], tmp_path: Path
) -> None:
    rig = make_rig()
    plant = rig.plant()
    eventually(lambda: "waiting for" in said(plant))
    port = rig.scenario.rig.base_port
    settings = ["--set", f"rig.base_port={port}", "--set", "run.duration_s=0.05"]
    done = decmesh("run", "paper", *settings, "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr


def test_a_folder_that_cannot_be_used_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a folder")
    done = decmesh("run", "paper", "--out", str(tmp_path / "file" / "run"))
    assert done.returncode == ExitCode.NO_OUTPUT
    assert len(done.stderr.splitlines()) == 1
    assert "--out" in done.stderr

    done = decmesh("run", "paper", "--out", str(tmp_path))
    assert done.returncode == ExitCode.NO_OUTPUT
    assert "is not empty" in done.stderr
    assert (tmp_path / "file").read_text() == "not a folder"


def test_a_bad_scenario_starts_nothing(tmp_path: Path) -> None:
    settings = ["--set", "run.duration_s=-1", "--set", "board.1.joint=ankle"]
    done = decmesh("run", "paper", *settings, "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.BAD_INPUT
    assert [line.split(": ")[1] for line in done.stderr.splitlines()] == [
        "run.duration_s",
        "board.1.joint",
    ]
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("module", ["plant_server", "module_agent"])
def test_processes_started_by_hand_check_their_scenario_first(
    make_rig: Callable[..., Rig], module: str
) -> None:
    rig = make_rig()
    joint = ["knee"] if module == "module_agent" else []
    process = rig.start(module, *joint, "--scenario", "paper", "--set", "run.tick_ms=0")
    assert process.wait(30) == ExitCode.BAD_INPUT
    assert "run.tick_ms: input should be greater than or equal to 0.1" in said(process)


def test_a_body_that_falls_is_a_result(tmp_path: Path) -> None:
    settings = ["--set", "board.0.servo.kp_nm_rad=0", "--set", "run.duration_s=5"]
    for mode in ([], ["--twin"]):
        folder = tmp_path / f"run{len(mode)}"
        done = decmesh("run", "paper", *mode, *settings, "--out", str(folder))
        assert done.returncode == ExitCode.FELL
        assert "fell at" in done.stderr
        assert "Traceback" not in done.stderr
        assert '"ending": "fell"' in (folder / "summary.json").read_text()


def test_resolved_scenarios_are_what_enrolment_compares() -> None:
    assert load("paper").digest == load("paper", ["rig.base_port=20000"]).digest
    assert load("paper").digest != load("paper", ["run.seed=2"]).digest
