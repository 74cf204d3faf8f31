"""Consensus measured with real processes: the same rounds as in the twin, and no process left."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import psutil
import pytest

from deploy.experiments.consensus.network import ConsensusCase, ConsensusNetwork
from deploy.experiments.consensus.processes import boards_max, play
from deploy.experiments.consensus.run import grid
from deploy.launch.processes import RunFailedError
from protocol.process.exit_codes import ExitCode
from tests.system.rig import alive, children_of, command_line, decmesh, eventually

EPOCHS = 60
ELECTOR = "module_agent.process.elector_runtime"


def case(graph: str, boards: int, loss: float, *, rounds: int | None = None) -> ConsensusCase:
    (made,) = grid(
        graphs=[graph], boards=[boards], losses=[loss], rounds=rounds, epochs=EPOCHS, seed=11
    )
    return made


@pytest.mark.parametrize(
    ("graph", "boards", "loss", "rounds"),
    [("line", 3, 0.3, 2), ("ring", 4, 0.1, None), ("random", 5, 0.0, 1)],
)
def test_processes_count_the_same_rounds_as_the_twin(
    graph: str, boards: int, loss: float, rounds: int | None
) -> None:
    """Lost frames, late agreement and several enabled boards too, epoch by epoch."""
    wanted = case(graph, boards, loss, rounds=rounds)
    network = ConsensusNetwork(wanted)
    with closing(play(wanted)) as epochs:
        found = list(epochs)
    assert [epoch._replace(wall_ms=None) for epoch in found] == [
        network.play(number) for number in range(EPOCHS)
    ]
    times_ms = [epoch.wall_ms for epoch in found]
    assert times_ms[0] is None, "boards were still arriving"
    assert all(time_ms is not None and time_ms >= 0.0 for time_ms in times_ms[1:])


def test_a_board_that_dies_ends_the_measurement_by_name_and_the_others_go() -> None:
    wanted = case("line", 3, 0.0)._replace(epochs=10**6)
    with closing(play(wanted)) as epochs:
        next(epochs)
        children = [pid for pid in children_of(os.getpid()) if ELECTOR in command_line(pid)]
        assert len(children) == 3
        victim = next(pid for pid in children if _option(pid, "--board") == "1")
        os.kill(victim, signal.SIGKILL)
        with pytest.raises(RunFailedError, match="board1 ended with code -9") as caught:
            list(epochs)
    assert caught.value.code == ExitCode.PEER_LOST
    eventually(lambda: not any(map(alive, children)))


def _option(pid: int, name: str) -> str:
    words = command_line(pid)
    return words[words.index(name) + 1]


def test_a_ctrl_c_keeps_what_is_done_and_leaves_no_process(tmp_path: Path) -> None:
    options = ("--boards", "3", "--graph", "line,ring", "--loss", "0", "--epochs", "100000")
    command = [sys.executable, "-m", "deploy", "measure", "consensus", "--processes", "--json"]
    launcher = subprocess.Popen(
        [*command, *options, "--out", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    eventually(lambda: len(children_of(launcher.pid)) == 3)
    boards = children_of(launcher.pid)
    eventually(lambda: any(_cpu_s(pid) > 0.5 for pid in boards))
    os.killpg(launcher.pid, signal.SIGINT)
    out, err = launcher.communicate(timeout=60)
    assert launcher.returncode == ExitCode.STOPPED
    assert not any(map(alive, boards))
    assert re.fullmatch(r"\d+ of 200000 epochs were played\nstopped\n", err)
    if out:  # It was not stopped before the first epoch.
        told = json.loads(out)
        assert told["complete"] is False
        assert 0 < sum(case["epochs"] for case in told["cases"]) < 200_000
        assert (tmp_path / "consensus.csv").exists()


def _cpu_s(pid: int) -> float:
    """CPU time that a process has used."""
    used = psutil.Process(pid).cpu_times()
    return used.user + used.system


def test_what_does_not_fit_on_the_machine_is_left_out_and_said(tmp_path: Path) -> None:
    small = ("--graph", "line", "--loss", "0", "--epochs", "5", "--out", str(tmp_path), "--json")
    too_many = boards_max() + 1
    done = decmesh("measure", "consensus", "--processes", "--boards", f"2,{too_many}", *small)
    assert done.returncode == ExitCode.OK
    assert re.match(rf"{too_many} boards are too many .* takes \d+ .*; left out$", done.stderr)
    assert [case["boards"] for case in json.loads(done.stdout)["cases"]] == [2]


def test_a_taken_port_is_one_line() -> None:
    who = ("--board", "0", "--neighbours", "1", "--boards", "2", "--rounds", "1")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        where = ("--base-port", str(port - 1))
        board = subprocess.run(
            [sys.executable, "-m", "module_agent.process.elector_runtime", *who, *where],
            capture_output=True,
            text=True,
            check=False,
            timeout=60,
        )
    assert board.returncode == ExitCode.NO_NETWORK
    assert re.match(rf"board0: cannot listen at tcp/127.0.0.1:{port}, choose", board.stderr)
    assert len(board.stderr.splitlines()) == 1
