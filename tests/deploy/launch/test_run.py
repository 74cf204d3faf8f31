"""A run has a folder of its own, and leaves its recording there."""

import resource
import signal
import time
from pathlib import Path

import pytest

from deploy.launch.folders import new_folder
from deploy.launch.processes import SPOOL, LaunchWatch, RunFailedError
from deploy.launch.run import run
from deploy.scenario_file.load import load
from plant_server.session.record import COMPLETE, STOPPED
from plant_server.spool.spool import Spool, read_spool
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import StoppedError, stop_on_signals
from tests.module_agent.outside import servo


def test_runs_of_the_same_second_get_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _format: "20260101-120000")
    names = [new_folder(None, "paper").name for _ in range(3)]
    first = "paper-20260101-120000"
    assert names == [first, f"{first}-2", f"{first}-3"]


def test_a_folder_that_is_named_may_be_there_but_must_be_empty(tmp_path: Path) -> None:
    assert new_folder(tmp_path, "paper") == tmp_path
    (tmp_path / "mine").touch()
    with pytest.raises(RunFailedError, match="not empty"):
        new_folder(tmp_path, "paper")


def in_twin(folder: Path, told: list[str], ticks: list[int]) -> Spool:
    scenario = load("paper", ["run.duration_s=0.05"])
    watch = LaunchWatch(on_tick=ticks.append, on_line=told.append)
    assert run(scenario, folder, twin=True, watch=watch) == ExitCode.OK
    return read_spool(folder / SPOOL)


def test_the_twin_records_what_it_does_but_no_wall_times(tmp_path: Path) -> None:
    ticks: list[int] = []
    spool = in_twin(tmp_path, [], ticks)
    assert [record.tick for record in spool.ticks] == ticks == list(range(-10, 50))
    assert set(spool.walls) == {None}
    assert spool.timings == []
    assert spool.facts["mode"] == "twin"
    assert spool.outcome is not None
    assert (spool.outcome.ending, spool.complete) == (COMPLETE, True)


ENDLESS = "import os, signal, time"
ENDLESS += "; seen.tick == 20 and (os.kill(os.getpid(), signal.SIGINT), time.sleep(10))"
ENDLESS += "; return 0.0"
"""Presses Ctrl-C, and does not come back for long."""


def test_ctrl_c_ends_a_twin_whose_controller_does_not_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tick that was open is no part of the run."""
    monkeypatch.chdir(tmp_path)
    servo(tmp_path, ENDLESS)
    scenario = load("paper", ["board.1.controller=my_servo:Mine"])
    ticks: list[int] = []
    watch = LaunchWatch(on_tick=ticks.append, on_line=lambda _line: None)
    handlers = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)]
    stop_on_signals()
    try:
        with pytest.raises(StoppedError):
            run(scenario, tmp_path, twin=True, watch=watch)
    finally:
        for number, handler in handlers:
            signal.signal(number, handler)
    spool = read_spool(tmp_path / SPOOL)
    assert ticks[-1] == spool.ticks[-1].tick == 19
    assert spool.outcome is not None
    assert spool.outcome.ending == STOPPED


def test_a_full_disk_is_told_and_the_twin_goes_on(tmp_path: Path) -> None:
    told: list[str] = []
    ticks: list[int] = []
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(ValueError, match="no complete chunk"):
            in_twin(tmp_path, told, ticks)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    (line,) = told
    assert line.startswith("recording ")
    assert "File too large" in line
    assert ticks[-1] == 49
