"""Ports belong to one robot at a time, and to nobody once its launcher is gone (S3)."""

import json
import signal
import socket
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
from msgspec.structs import asdict, replace

from deploy.launch import rigs
from deploy.scenario_file.load import load
from protocol.robot.scenario import Scenario

HOLDER = """
import sys, time
from pathlib import Path
from deploy.launch import rigs
from deploy.scenario_file.load import load
with rigs.claim(load("paper", [f"rig.base_port={sys.argv[1]}"]), Path()) as placed:
    print(placed.rig.base_port, flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def runtime_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A runtime folder of the test's own."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "decmesh"


@pytest.fixture
def scenario() -> Scenario:
    """The paper's, to be placed where this machine has room."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return load("paper", [f"rig.base_port={min(port, 60_000)}"])


def ports(placed: Scenario) -> set[int]:
    base = placed.rig.base_port
    return set(range(base, base + 1 + len(placed.joints)))


def test_s3_two_claims_never_share_ports(scenario: Scenario, tmp_path: Path) -> None:
    """Also before either has opened a port: the lock is what counts."""
    with ExitStack() as stack:
        claimed = [ports(stack.enter_context(rigs.claim(scenario, tmp_path))) for _ in range(5)]
    assert len(set.union(*claimed)) == 5 * 4


def test_a_claim_changes_where_a_robot_lives_and_not_what_it_is(
    scenario: Scenario, tmp_path: Path
) -> None:
    with rigs.claim(scenario, tmp_path), rigs.claim(scenario, tmp_path) as second:
        assert second.rig != scenario.rig
        assert replace(second, rig=scenario.rig) == scenario
        assert second.digest == scenario.digest


def test_the_rig_file_says_which_robot_it_is_and_goes_with_it(
    scenario: Scenario, runtime_folder: Path, tmp_path: Path
) -> None:
    with rigs.claim(scenario, tmp_path / "run") as placed:
        (file,) = runtime_folder.iterdir()
        about = json.loads(file.read_text())
        assert about.items() >= asdict(placed.rig).items()
        assert (about["scenario"], about["run"]) == ("paper", str(tmp_path / "run"))
    assert not list(runtime_folder.iterdir())


def test_the_rig_file_goes_when_a_run_fails(
    scenario: Scenario, runtime_folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(KeyboardInterrupt), rigs.claim(scenario, tmp_path):
        raise KeyboardInterrupt
    assert not list(runtime_folder.iterdir())


def test_the_file_of_a_killed_process_means_nothing(
    scenario: Scenario, runtime_folder: Path, tmp_path: Path
) -> None:
    wanted = str(scenario.rig.base_port)
    command = [sys.executable, "-c", HOLDER, wanted]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        held = int(holder.stdout.readline())
        with rigs.claim(scenario, tmp_path) as other:
            assert held not in ports(other)
        holder.send_signal(signal.SIGKILL)
    stale = runtime_folder / f"{held}.json"
    assert stale.exists()
    again = load("paper", [f"rig.base_port={held}"])
    with rigs.claim(again, tmp_path) as placed:
        assert placed.rig.base_port == held
    assert not stale.exists()


@pytest.mark.parametrize("content", ["", "{", "{}"])
def test_a_robot_that_says_too_little_is_passed_over_all_the_same(
    scenario: Scenario, runtime_folder: Path, tmp_path: Path, content: str
) -> None:
    with rigs.claim(scenario, tmp_path) as first:
        (file,) = runtime_folder.iterdir()
        file.write_text(content)
        with rigs.claim(scenario, tmp_path) as second:
            assert ports(first).isdisjoint(ports(second))


def test_ports_that_somebody_else_listens_on_are_passed_over(
    scenario: Scenario, tmp_path: Path
) -> None:
    with rigs.claim(scenario, tmp_path) as placed:
        taken = max(ports(placed))
    with socket.socket() as stranger:
        stranger.bind(("127.0.0.1", taken))
        stranger.listen()
        with rigs.claim(scenario, tmp_path) as placed:
            assert taken not in ports(placed)


def test_no_ports_at_all_is_one_line(tmp_path: Path) -> None:
    """The highest four ports that there are, and they are held."""
    last = load("paper", [f"rig.base_port={rigs.PORT_MAX - 3}"])
    with (
        rigs.claim(last, tmp_path),
        pytest.raises(rigs.NoPortsError, match=r"^no 4 free ports in a row on 127\.0\.0\.1"),
        rigs.claim(last, tmp_path),
    ):
        pass


@pytest.mark.parametrize("apart", range(-3, 4))
def test_claims_may_not_overlap_either(scenario: Scenario, tmp_path: Path, apart: int) -> None:
    base = scenario.rig.base_port
    near = load("paper", [f"rig.base_port={base + apart}"])
    with rigs.claim(scenario, tmp_path) as first, rigs.claim(near, tmp_path) as second:
        assert ports(first).isdisjoint(ports(second))


def test_launchers_that_come_and_go_at_once_never_share_ports(
    scenario: Scenario, tmp_path: Path
) -> None:
    """Eight of them, each many times; a port that two hold at a time would be seen twice."""
    held: set[int] = set()
    guard = threading.Lock()

    def come_and_go(_launcher: int) -> None:
        for _ in range(20):
            with rigs.claim(scenario, tmp_path) as placed:
                with guard:
                    assert held.isdisjoint(ports(placed))
                    held.update(ports(placed))
                with guard:
                    held.difference_update(ports(placed))

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(come_and_go, range(8)))
    assert not held
