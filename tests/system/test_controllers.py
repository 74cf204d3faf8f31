"""Somebody else's controller in real processes: as in the twin, and no harm to anybody."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.results import read_run
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from protocol.process.exit_codes import ExitCode, refused
from protocol.wire.enrolment import EnrolmentVerdict
from tests.module_agent.outside import SERVO
from tests.system.rig import Rig, decmesh, eventually, recorded_ticks, said

SHORT = "run.duration_s=0.4"


def named(folder: Path, body: str, lines: str = "") -> str:
    """A scenario whose knee has this servo."""
    (folder / "my_servo.py").write_text(SERVO.format(body=body), encoding="utf-8")
    file = folder / "mine.toml"
    file.write_text(f'{lines}\nextends = "paper"\ncontroller = {{knee = "my_servo:Mine"}}\n')
    return str(file)


def status(rig: Rig) -> dict[str, Any]:
    port = rig.scenario.rig.base_port
    found: dict[str, Any] = json.loads(
        decmesh("status", "--json", "--rig", f"127.0.0.1:{port}").stdout
    )
    return found


def test_a_report_and_tables_are_made_without_the_controllers_that_ran(tmp_path: Path) -> None:
    """Whoever reads a recording runs nobody's code: the file need not even be there."""
    file = named(tmp_path, "return 1.0")
    folder = tmp_path / "run"
    done = decmesh("run", file, "--set", SHORT, "--twin", "--json", "--out", str(folder))
    assert done.returncode == ExitCode.OK, done.stderr
    (tmp_path / "my_servo.py").unlink()
    for words in (["report"], ["export", "--to", "npz"]):
        done = decmesh(words[0], str(folder), *words[1:])
        assert done.returncode == ExitCode.OK, done.stderr
    assert {"report.html", "ticks.npz", "epochs.npz"} <= {path.name for path in folder.iterdir()}
    done = decmesh("replay", str(folder))
    assert done.returncode == ExitCode.BAD_INPUT, "a replay needs it"
    assert "my_servo" in done.stderr


def test_processes_equal_the_twin_to_the_bit_and_in_what_failed_where(tmp_path: Path) -> None:
    """An election of its own on all boards, and on the knee a servo that prints and fails."""
    body = "print('tick', seen.tick)\n        return 20.0 / (seen.tick - 222)"
    file = named(tmp_path, body, lines='election = "hysteresis:Hysteresis"')
    (tmp_path / "hysteresis.py").write_bytes(Path("deploy/scenarios/hysteresis.py").read_bytes())
    done = decmesh("run", file, "--set", SHORT, "--json", "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    summary = json.loads(done.stdout)
    (fault,) = summary["faults"]
    assert (fault["joint"], fault["tick"], fault["code"]) == ("knee", 222, 1)
    assert "knee has failed in tick 222: fault 1 (controller raised)" in done.stderr
    assert done.stderr.count("Traceback") == 1
    run = read_run(tmp_path / "run")
    assert run is not None
    scenario = load(file, [SHORT])
    twin = trajectory(scenario, *run_twin(scenario))
    assert run.events == twin.events
    assert run.state_sha256 == twin.state_sha256


def test_boards_with_another_file_are_refused(make_rig: Callable[..., Rig], tmp_path: Path) -> None:
    """Whether they resolve the scenario themselves, or were given it resolved."""
    rig = make_rig(SHORT, source=named(tmp_path, "return 0.0"))
    plant = rig.plant()
    eventually(lambda: "waiting for" in said(plant))
    file = named(tmp_path, "return 1.0")
    port = rig.scenario.rig.base_port
    settings = ["--set", SHORT, "--set", f"rig.base_port={port}"]
    stranger = rig.start("module_agent", "knee", "--scenario", file, *settings)
    assert stranger.wait(30) == refused(EnrolmentVerdict.OTHER_SCENARIO)
    given = rig.board("knee")
    assert given.wait(30) == ExitCode.BAD_INPUT
    assert said(given).endswith("my_servo.py: has changed since the scenario was resolved\n")
    others = rig.board("hip")
    eventually(lambda: "waiting for ankle, knee" in said(plant))
    assert others.poll() is None, "its own controller is ours, so it does not look at the file"


def test_a_class_that_does_not_fit_starts_nothing(tmp_path: Path) -> None:
    file = named(tmp_path, "return 0.0")
    (tmp_path / "my_servo.py").write_text("class Mine: pass\n")
    line = f"{file}: controller.knee: my_servo:Mine: has no method torque_nm(seen)\n"
    for command in (["run", file, "--out", str(tmp_path / "run")], ["check", file]):
        done = decmesh(*command)
        assert (done.returncode, done.stderr) == (ExitCode.BAD_INPUT, line)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("module", ["plant_server", "module_agent"])
def test_processes_started_by_hand_try_it_first(
    make_rig: Callable[..., Rig], tmp_path: Path, module: str
) -> None:
    rig = make_rig()
    file = named(tmp_path, "return 0.0")
    (tmp_path / "my_servo.py").write_text("import no_such_library\n")
    joint = ["knee"] if module == "module_agent" else []
    process = rig.start(module, *joint, "--scenario", file)
    assert process.wait(30) == ExitCode.BAD_INPUT
    assert "ModuleNotFoundError: No module named 'no_such_library'" in said(process)


WAITS = """import pathlib
        while seen.tick == 100 and not pathlib.Path({go!r}).exists():
            pass
        return -50.0 * seen.error_rad"""


def test_a_controller_that_does_not_come_back_is_named_and_waited_for(
    make_rig: Callable[..., Rig], tmp_path: Path
) -> None:
    """No wall-clock failsafe in lockstep: it may be in a debugger. Waiting changes nothing."""
    go = tmp_path / "go"
    rig = make_rig(SHORT, source=named(tmp_path, WAITS.format(go=str(go))))
    plant = rig.plant("--progress", "--spool", str(rig.folder / "run.spool"))
    boards = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: "knee: stuck in tick 100, in " in said(boards["knee"]))
    assert "my_servo.py:" in said(boards["knee"])
    eventually(lambda: "knee is stuck in tick 100" in said(plant))
    assert [board["stuck"] for board in status(rig)["boards"]] == [0, 1, 0]
    go.touch()
    processes = [plant, *boards.values()]
    assert [process.wait(60) for process in processes] == [ExitCode.OK] * 4
    run = read_run(rig.folder)
    assert run is not None
    twin = trajectory(rig.scenario, *run_twin(rig.scenario))
    assert run.state_sha256 == twin.state_sha256
    assert run.events == twin.events, "who was slow is no part of the run"


def test_a_controller_that_does_not_come_back_can_be_stopped(
    make_rig: Callable[..., Rig], tmp_path: Path
) -> None:
    """Also one that handles every Exception."""
    body = "while seen.tick == 100:\n            try: pass\n            except Exception: pass"
    rig = make_rig(SHORT, source=named(tmp_path, f"{body}\n        return 0.0"))
    rig.plant()
    boards = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: "stuck in tick 100" in said(boards["knee"]))
    boards["knee"].send_signal(signal.SIGINT)
    assert boards["knee"].wait(30) == ExitCode.STOPPED


def test_a_failed_board_is_shown_and_can_be_exchanged(
    make_rig: Callable[..., Rig], tmp_path: Path
) -> None:
    """State, code and text in the status; its successor drives again."""
    once = tmp_path / "failed"
    body = f"import pathlib\n        once = pathlib.Path({str(once)!r})\n"
    body += "        if seen.tick > 50 and not once.exists():\n            once.touch()\n"
    body += "            raise ValueError('just once')\n        return -200.0 * seen.error_rad"
    upright = [f"board.{i}.initial_deg=0" for i in range(3)]  # It stands with a limp knee as well.
    rig = make_rig("run.duration_s=600", *upright, source=named(tmp_path, body))
    plant = rig.plant()
    eventually(lambda: "waiting for" in said(plant))
    assert [board["state"] for board in status(rig)["boards"]] == ["absent"] * 3
    knee = rig.board("knee")
    eventually(lambda: status(rig)["boards"][1]["state"] == "enrolling")
    for joint in ("ankle", "hip"):
        rig.board(joint)
    eventually(lambda: status(rig)["boards"][1]["state"] == "fault")
    told = status(rig)["boards"][1]
    assert (told["enabled"], told["torque_nm"]) == (False, 0.0)
    assert (told["fault"]["code"], told["fault"]["name"]) == (1, "controller raised")
    assert told["fault"]["text"].startswith("ValueError: just once\nmy_servo.py:")
    port = rig.scenario.rig.base_port
    shown = decmesh("status", "--rig", f"127.0.0.1:{port}").stdout
    assert "knee: fault 1 (controller raised), ValueError: just once" in shown
    knee.kill()
    eventually(lambda: status(rig)["boards"][1]["state"] == "absent")
    rig.board("knee")
    eventually(lambda: status(rig)["boards"][1]["state"] == "running")
    assert status(rig)["boards"][1]["fault"] is None
    plant.send_signal(signal.SIGINT)
    plant.wait(30)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_twin_in_which_a_controller_hangs_can_be_stopped(
    tmp_path: Path, number: signal.Signals
) -> None:
    """In the middle of a tick, of which nothing is left; of those before there is everything."""
    file = named(tmp_path, "while seen.tick == 300:\n            pass\n        return 0.0")
    run = tmp_path / "run"
    command = [sys.executable, "-m", "deploy", "run", file, "--twin", "--out", str(run)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        eventually(lambda: recorded_ticks(run / "run.spool") > 200)
        time.sleep(0.5)  # It is there long before.
        process.send_signal(number)
        assert process.wait(30) == ExitCode.STOPPED
    assert json.loads((run / "summary.json").read_text())["ticks"] == 300
    assert decmesh("replay", str(run)).stdout == "identical: 300 ticks\n"
