"""Runs of real processes, whatever became of them: the twin plays them again, to the bit."""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest

from deploy.launch.terminal_session import LiveError, Terminal
from deploy.recording.differences import first_difference
from deploy.recording.mcap.file import read_mcap
from deploy.recording.reading import read_recording
from deploy.recording.spools import read_spool_of
from deploy.recording.trajectory import CUT_OFF
from plant_server.session.record import COMPLETE, STOPPED
from plant_server.spool.spool import read_spool
from protocol.process.exit_codes import ExitCode
from protocol.robot.events import (
    Command,
    LinkChange,
    LinkRepair,
    Push,
    ReferenceChange,
    SensorFault,
    Unplug,
    tag_of,
)
from protocol.wire.wiring import rig_of
from tests.deploy.checker import check
from tests.deploy.spools import SHORT
from tests.system.rig import Process, Rig, decmesh, eventually, recorded_ticks, said

JOINTS = ("ankle", "knee", "hip")


def settings(name: str) -> list[str]:
    return [word for setting in SHORT[name] for word in ("--set", setting)]


@pytest.mark.parametrize("name", ["paper", "storm"])
def test_s20_processes_and_twin_leave_the_same_recording_but_for_clocks_and_hosts(
    tmp_path: Path, name: str
) -> None:
    digests = set()
    for mode in ([], ["--twin"]):
        folder = str(tmp_path / f"run{len(mode)}")
        done = decmesh("run", name, *settings(name), *mode, "--out", folder, "--json")
        assert done.returncode == ExitCode.OK, done.stderr
        digests.add(json.loads(done.stdout)["logical_sha256"])
        check(read_spool_of(Path(folder)))
        replay = decmesh("replay", folder)
        assert replay.stdout.startswith("identical: "), replay.stderr
    assert len(digests) == 1
    assert not (tmp_path / "run0" / "run.spool").exists()


def test_a_recording_of_processes_knows_when_frames_were_under_way(tmp_path: Path) -> None:
    """One machine, one clock: a frame arrives after it was said."""
    done = decmesh("run", "paper", *settings("paper"), "--out", str(tmp_path / "run"))
    assert done.returncode == ExitCode.OK, done.stderr
    found = read_recording(tmp_path / "run")
    assert found.clocks_shared
    assert set(found.processes) == {"plant", *JOINTS}
    for frames in found.links.values():
        assert frames.sent.all()
        assert (frames.arrived_ns[:-1] >= frames.sent_ns[:-1] - 1000).all()
        assert frames.arrived_ns[:-1].all()
        assert frames.arrived_ns[-1] == 0, "nobody was left to hear the last one"
    assert (found.taken_up_ns >= found.opened_ns[:, None] - 1000).all()
    assert (found.answered_ns <= found.closed_ns[:, None]).all()
    assert (found.decided_ns <= found.answered_ns).all()


class Vandal:
    """Does to a running robot what comes to its mind."""

    def __init__(self, rig: Rig, seed: int) -> None:
        self.rig = rig
        self.chance = Random(seed)
        self.boards: dict[str, Process | None] = {joint: rig.board(joint) for joint in JOINTS}

    def act(self, terminal: Terminal, plant: Process) -> None:
        """All of it, in some order, with a while of peace after each deed."""
        deeds = [self.kill] * 3 + [self.start] * 4 + [self.freeze] * 2 + [self.unplug]
        deeds += [self.type] * 8
        terminal.command(Push(2, 5.0, 30))
        for deed in self.chance.sample(deeds, len(deeds)):
            if plant.poll() is not None:
                return  # Without boards, ticks fly.
            deed(terminal)
            time.sleep(self.chance.uniform(0.0, 0.1))

    def type(self, terminal: Terminal) -> None:
        """Type a command; one that cannot take effect is refused, and did not happen."""
        with suppress(LiveError):
            terminal.command(self.command())

    def command(self) -> Command:
        chance = self.chance
        pair = chance.choice(((0, 1), (1, 0), (1, 2), (2, 1)))
        changes = chance.choice(({"cut": 1.0}, {"loss": 0.4}, {"delay_ticks": 3.0}))
        return chance.choice(
            (
                LinkChange(chance.choice(((), (pair,))), changes),
                LinkRepair(()),
                Push(chance.randrange(3), chance.uniform(-10.0, 10.0), 30),
                ReferenceChange(chance.randrange(3), chance.uniform(-0.02, 0.02)),
                SensorFault(chance.randrange(3), "encoder", "garbage", 0.0, 20),
            )
        )

    def some_board(self) -> tuple[str, Process]:
        """One of the boards that are running; of the last one, others are started first."""
        if sum(board is not None for board in self.boards.values()) < 2:
            self.start(None)
        running = [(joint, board) for joint, board in self.boards.items() if board is not None]
        return self.chance.choice(running)

    def kill(self, _terminal: Terminal) -> None:
        """In whatever it is doing."""
        joint, board = self.some_board()
        os.kill(board.pid, signal.SIGKILL)
        board.wait()
        self.boards[joint] = None

    def start(self, _terminal: Terminal | None) -> None:
        """Put boards in unasked."""
        for joint, board in self.boards.items():
            if board is None:
                self.boards[joint] = self.rig.board(joint)

    def freeze(self, _terminal: Terminal) -> None:
        """For longer than the plant is patient; it may enrol again."""
        _, board = self.some_board()
        board.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        board.send_signal(signal.SIGCONT)

    def unplug(self, terminal: Terminal) -> None:
        """Ask first, then end the process."""
        joint, board = self.some_board()
        with suppress(LiveError):
            terminal.command(Unplug(JOINTS.index(joint)))
        board.kill()
        board.wait()
        self.boards[joint] = None


@pytest.mark.parametrize("seed", [1, 2])
def test_a_robot_that_was_poked_from_outside_at_random_replays(
    make_rig: Callable[..., Rig], seed: int
) -> None:
    """Typed commands, kills, freezes, boards put in by hand, at any moment: to the bit."""
    rig = make_rig("run.duration_s=20", "unattended.how=braked")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--progress", "--patience", "300ms", "--spool", str(spool))
    vandal = Vandal(rig, seed)
    eventually(lambda: said(plant))
    with Terminal(rig_of(rig.scenario)) as terminal:
        vandal.act(terminal, plant)
    plant.send_signal(signal.SIGINT)
    assert plant.wait(60) in (ExitCode.STOPPED, ExitCode.OK)
    recorded = read_spool(spool)
    assert recorded.outcome is not None
    assert recorded.outcome.ending in (STOPPED, COMPLETE)
    seen = {tag_of(event) for record in recorded.ticks for event in record.events}
    assert seen >= {"admitted", "push", "energy_lost_j"}
    assert seen & {"gone", "gone_midway"}
    assert first_difference(recorded, lambda _tick: None) is None
    check(recorded)


def test_what_a_killed_plant_has_recorded_is_recovered(
    make_rig: Callable[..., Rig],
) -> None:
    rig = make_rig("run.duration_s=600")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--spool", str(spool))
    for joint in JOINTS:
        rig.board(joint)
    eventually(lambda: recorded_ticks(spool) > 300)
    os.kill(plant.pid, signal.SIGKILL)
    plant.wait()
    done = decmesh("recover", str(rig.folder), "--json")
    facts = json.loads(done.stdout)
    assert facts["ticks"] >= 290
    assert not facts["complete"]
    back = read_mcap(rig.folder / "run.mcap")
    assert back.ticks == read_spool(spool).ticks
    replay = decmesh("replay", str(rig.folder))
    told = f"identical: {facts['ticks']} ticks; the recording is incomplete\n"
    assert replay.stdout == told


def limited(file_bytes: int) -> Callable[[], None]:
    """In a child: no file may be larger, as on a disk with so much room."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))

    return limit


def run_with_room(folder: Path, file_bytes: int) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "deploy", "run", "paper", "--set", "run.duration_s=2"]
    return subprocess.run(
        [*command, "--twin", "--json", "--out", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        preexec_fn=limited(file_bytes),
    )


def test_without_room_for_run_mcap_the_run_counts_and_the_spool_stays(tmp_path: Path) -> None:
    """2 s take 0.6 MB as a spool and 1.5 MB as MCAP."""
    folder = tmp_path / "run"
    done = run_with_room(folder, 1_000_000)
    assert done.returncode == ExitCode.OK
    assert json.loads(done.stdout)["ticks"] == 2000
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"cannot write to {folder}: File too large; decmesh recover ")
    assert {path.name for path in folder.iterdir()} == {"run.spool", "summary.json"}
    recovered = decmesh("recover", str(folder))
    assert recovered.stdout == f"{folder / 'run.mcap'}: 2000 ticks\n"


def test_without_room_for_the_spool_there_are_results_up_to_there(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    done = run_with_room(folder, 400_000)
    assert done.returncode == ExitCode.NO_OUTPUT
    first, last = done.stderr.splitlines()
    # A fast machine is through with the run before its disk has said no.
    assert first.startswith(("recording stopped at tick ", "recording is incomplete: "))
    assert last.startswith(f"cannot write to {folder}: File too large; decmesh recover ")
    summary = json.loads(done.stdout)
    assert summary == json.loads((folder / "summary.json").read_text())
    assert summary["ending"] == CUT_OFF
    assert 100 < summary["ticks"] < 2000
    recovered = decmesh("recover", str(folder), "--out", str(tmp_path / "elsewhere"))
    ticks = read_spool_of(folder).ticks[-1].tick + 1
    said = f"{tmp_path / 'elsewhere' / 'run.mcap'}: {ticks} ticks; the recording is incomplete\n"
    assert recovered.stdout == said
    assert summary["ticks"] == ticks - 1, "where the last recorded tick led to is not known"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A real disk of 1 MB, where this process may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    mounted = subprocess.run(command, capture_output=True, text=True, check=False)
    if mounted.returncode != 0:
        pytest.skip(f"no disk may be mounted here: {mounted.stderr.strip()}")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_full_disk_disturbs_no_board_and_what_it_holds_is_recovered_elsewhere(
    small_disk: Path, tmp_path: Path
) -> None:
    folder = small_disk / "run"
    length = ("--set", "run.duration_s=6")
    done = decmesh("run", "paper", *length, "--out", str(folder), "--json")
    assert done.returncode == ExitCode.NO_OUTPUT
    first, last = done.stderr.splitlines()
    assert re.match("plant: recording .*: No space left on device", first), "no board had trouble"
    assert last.startswith(f"cannot write to {folder}: No space left on device; decmesh recover ")
    ticks = json.loads(done.stdout)["ticks"]
    assert ticks > 1000
    back = read_spool_of(folder)
    recovered = decmesh("recover", str(folder), "--out", str(tmp_path / "elsewhere"))
    assert recovered.returncode == ExitCode.OK, recovered.stderr
    assert read_mcap(tmp_path / "elsewhere" / "run.mcap").ticks == back.ticks
    replayed = decmesh("replay", str(tmp_path / "elsewhere"))
    assert replayed.stdout == f"identical: {ticks + 1} ticks; the recording is incomplete\n"
