"""A whole robot in realtime, on a wall clock that the test moves: what holds however time goes.

Times, oversleeping and latencies are drawn from a seed, so a failure can be played again.
"""

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.indices import elections
from deploy.outcome.realtime_summary import realtime_summary
from deploy.outcome.realtime_table import verdict
from deploy.recording.realtime_replay import RealtimeReplay, replay
from deploy.recording.realtime_times import realtime_times, turns
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from plant_server.spool.spool import Spool
from protocol.robot.events import Ready, tag_of
from protocol.robot.states import State
from tests.realtime.robot import MS, Host, RealtimeRobot

pytestmark = pytest.mark.slow

SECOND = ("run.mode=realtime", "run.duration_s=1")
QUIET = Host()
BUSY = Host(busy=0.05, busy_ns=12 * MS)
DRIFTING = Host(ppm={0: 500.0, 1: -500.0, 2: 200.0})
HOSTS = {"quiet": QUIET, "busy": BUSY, "drifting": DRIFTING}


@cache
def played(host: str, *settings: str) -> Spool:
    return RealtimeRobot(load("paper", [*SECOND, *settings]), HOSTS[host]).spool()


def arrays(spool: Spool) -> Trajectory:
    assert spool.outcome is not None
    return trajectory(spool.scenario, spool.ticks, spool.outcome)


def summed_up(spool: Spool) -> dict[str, Any]:
    times = realtime_times(spool)
    assert times is not None
    return {**realtime_summary(times, arrays(spool).joints)}


def test_on_a_quiet_host_it_moves_as_in_lockstep() -> None:
    """No sample is the same, and the movement is within half a degree (the body turns by 33)."""
    found = arrays(played("quiet"))
    scenario = load("paper", ["run.duration_s=1"])
    twin = trajectory(scenario, *run_twin(scenario))
    apart_rad = np.abs(found.orientations_rad - twin.orientations_rad).max()
    assert np.degrees(apart_rad) < 0.5
    assert (found.state == State.RUNNING).mean() > 0.99


@pytest.mark.parametrize("rate_hz", [1000, 250, 200])
def test_it_stands_at_other_rates(rate_hz: int) -> None:
    found = arrays(played("quiet", f"realtime.rate_hz={rate_hz}"))
    assert np.degrees(np.abs(found.orientations_rad[-1])).max() < 10.0


def test_boards_may_differ_in_their_rates() -> None:
    spool = played("quiet", "board.0.rate_hz=250", "board.2.rate_hz=1000")
    found = arrays(spool)
    assert np.degrees(np.abs(found.orientations_rad[-1])).max() < 10.0
    assert (found.state == State.RUNNING).mean() > 0.95, "a slower board is no gap"
    rates = [board["rate_hz"] for board in summed_up(spool)["boards"].values()]
    assert rates == [250.0, 500.0, 1000.0]


@pytest.mark.parametrize("host", ["quiet", "drifting"])
def test_every_epoch_elects_exactly_one(host: str) -> None:
    """Also with clocks that drift apart by a thousandth: epochs are the plant's."""
    found = elections(arrays(played(host)))
    assert found is not None
    assert (found.epochs, found.enabled_1) == (10, 10)
    assert found.rounds_to_agreement["never"] == 0
    for board in summed_up(played(host))["boards"].values():
        assert (board["epochs_decided"], board["epochs_missed"]) == (10, 0)
        assert 8.0 <= board["decision_ms"]["p50"] <= 12.0, "two rounds of 4 ms and a period"


@pytest.mark.parametrize("ppm", [500.0, -500.0])
def test_no_board_is_in_another_epoch_for_a_drifting_clock_or_a_lost_observation(
    ppm: float,
) -> None:
    """But for half a period at its border, which is as well as clocks agree."""
    host = Host(ppm={0: ppm, 1: -ppm, 2: 0.0}, loss=0.3)
    robot = RealtimeRobot(load("paper", [*SECOND, "run.duration_s=3"]), host)
    found = arrays(robot.spool())
    ticks = np.arange(found.ticks)
    inside = (ticks % 100 >= 8) & (ticks % 100 < 97)
    assert (found.epoch[inside] == (ticks[inside] // 100)[:, None]).all()


@pytest.mark.parametrize("missed", ["skip", "catch-up"])
def test_every_deadline_is_accounted_for(missed: str) -> None:
    """In time, late or skipped; by name of what was done, and as many as there was time for."""
    spool = played("busy", f"realtime.missed={missed}")
    found = summed_up(spool)
    assert found["missed"] == missed
    for board in found["boards"].values():
        assert board["in_time"] + board["late"] + board["skipped"] == board["periods"]
        assert abs(board["periods"] - 500) <= 8, "a second at 500 Hz, and the ends of it"
        assert 0.0 < board["missed_share"] < 0.5
        assert (board["skipped"] == 0) == (missed == "catch-up")
        assert board["late"] > 0
    for (ticks,) in turns(spool):
        slots = [tick.slot for tick in ticks]
        assert all(b > a for a, b in pairwise(slots))
        assert (slots == list(range(slots[0], slots[-1] + 1))) == (missed == "catch-up")


def test_ages_are_those_of_the_made_up_network() -> None:
    """Latency is 0.08 to 0.25 ms, a turn 0.15 to 0.3 ms; boards begin at their phases."""
    boards = summed_up(played("quiet"))["boards"]
    for joint, phase_ms in (("hip", 0.5), ("knee", 1.0), ("ankle", 1.5)):
        board = boards[joint]
        assert phase_ms <= board["observation_age_ms"]["p50"] <= phase_ms + 0.3
        assert 0.02 <= board["wake_late_ms"]["p50"] <= 0.13
        assert 0.15 <= board["busy_ms"]["p50"] <= 0.31
        assert board["period_ms"]["p50"] == pytest.approx(2.0, abs=0.02)
        assert 0.0 < board["torque_age_ms"]["p50"] < 2.0
        assert board["torque_stale_ticks"] == 0
    assert set(boards["knee"]["neighbour_age_ms"]) == {"ankle", "hip"}
    assert 0.0 < boards["knee"]["neighbour_age_ms"]["hip"]["max"] < 2.6


def test_a_plant_that_is_held_up_catches_up() -> None:
    host = Host(stall=0.01, busy_ns=40 * MS)
    spool = RealtimeRobot(load("paper", [*SECOND]), host).spool()
    found = summed_up(spool)
    assert found["behind_ms_max"] > 20.0
    assert found["slipped_s"] == 0.0
    assert np.degrees(np.abs(arrays(spool).orientations_rad[-1])).max() < 10.0
    assert replay(spool).differences == ()


@pytest.mark.parametrize("times", [1.2, 3.0])
def test_a_host_that_is_too_slow_says_by_how_much_and_the_body_stands(times: float) -> None:
    """Boards follow the plant's ticks, however slowly they come."""
    tick_ns = round(times * MS)
    host = Host(plant_ns=(tick_ns, tick_ns + 1))
    spool = RealtimeRobot(load("paper", [*SECOND]), host).spool()
    found = summed_up(spool)
    assert found["slipped_s"] == pytest.approx((times - 1.0) * len(spool.ticks) / 1e3, abs=0.11)
    assert "wall time" in verdict(found)
    assert np.degrees(np.abs(arrays(spool).orientations_rad[-1])).max() < 10.0
    assert all(board["epochs_decided"] >= 9 for board in found["boards"].values())


def test_what_was_used_is_used_again() -> None:
    """The same torques and link frames come out, to the bit, of what was recorded (S24)."""
    for host in HOSTS:
        spool = played(host)
        found = replay(spool)
        assert found.differences == ()
        assert found.unplayed == 0
        assert found.ticks == len(spool.ticks)
        assert found.periods == sum(len(life) for (life,) in turns(spool))
        assert found.torques > 1000


def test_a_replay_notices_what_is_not_as_it_was() -> None:
    spool = played("quiet")
    ticks = list(spool.ticks)
    one = ticks[800]
    ticks[800] = one._replace(torques_nm=(one.torques_nm[0] + 1e-9, *one.torques_nm[1:]))
    assert _differences(spool._replace(ticks=ticks)) != ()
    told = list(spool.realtime)
    del told[20]
    gap = replay(spool._replace(realtime=tuple(told)))
    assert gap.differences or gap.unplayed


def _differences(spool: Spool) -> tuple[str, ...]:
    found: RealtimeReplay = replay(spool)
    return found.differences


def test_links_fail_and_boards_come_and_go(tmp_path: Path) -> None:
    """Faults, commands and hot-plug, played again to the bit."""
    path = tmp_path / "rough.toml"
    path.write_text(
        """
        extends = "paper"
        [run]
        mode = "realtime"
        duration_s = 1.5
        [unattended]
        how = "braked"
        [[link]]
        loss = 0.2
        delay_ms = 3
        jitter_ms = 4
        duplicate = 0.1
        corrupt = 0.05
        [[event]]
        at_s = 0.2
        do = "cut"
        link = "ankle-knee"
        duration_s = 0.2
        [[event]]
        at_s = 0.5
        do = "unplug"
        joint = "hip"
        [[event]]
        at_s = 0.7
        do = "plug"
        joint = "hip"
        [[event]]
        at_s = 0.9
        do = "push"
        segment = "trunk"
        force_n = 20.0
        [[event]]
        at_s = 1.0
        do = "reference"
        joint = "hip"
        reference_deg = 2.0
        """,
        encoding="utf-8",
    )
    spool = RealtimeRobot(load(str(path)), DRIFTING).spool()
    found, boards = replay(spool), arrays(spool)
    assert summed_up(spool)["boards"]["hip"]["period_ms"]["max"] < 100.0, "it was away for longer"
    assert summed_up(spool)["boards"]["knee"]["neighbour_age_ms"]["hip"]["max"] < 100.0
    assert (found.differences, found.unplayed) == ((), 0)
    assert not boards.state[520:690, 2].any(), "nobody drives the hip"
    assert (boards.state[800:, 2] > State.SYNCING).all(), "somebody does again"
    assert State.RECKONING in boards.state[250:400, 0], "the ankle is cut off"
    assert abs(boards.controlled_rad[-1, 2]) < 0.2


@pytest.mark.parametrize("seed", [1, 4, 5])
def test_a_new_board_has_not_the_age_of_what_the_old_one_said(seed: int) -> None:
    """Not even in a turn whose board has not been told yet that it is there: its news were lost."""
    events = ["event.0.at_s=0.2", "event.1.at_s=0.5", "run.duration_s=0.7"]
    scenario = load("hotplug", ["run.mode=realtime", "unattended.how=braked", *events])
    spool = RealtimeRobot(scenario, Host(seed=seed, loss=0.3)).spool()
    assert summed_up(spool)["boards"]["knee"]["neighbour_age_ms"]["hip"]["max"] < 20.0


def test_hardware_is_played_again_too(tmp_path: Path) -> None:
    """Broken sensors, slow motors, a foot that tips, a board that takes its time to start."""
    path = tmp_path / "hardware.toml"
    path.write_text(
        """
        extends = "short-foot"
        [run]
        mode = "realtime"
        duration_s = 1.5
        [[event]]
        at_s = 0.3
        do = "sensor"
        joint = "hip"
        sensor = "imu"
        fault = "garbage"
        duration_s = 0.05
        [[event]]
        at_s = 0.5
        do = "push"
        segment = "trunk"
        force_n = -150.0
        duration_s = 0.1
        [[event]]
        at_s = 0.7
        do = "unplug"
        joint = "knee"
        [[event]]
        at_s = 0.8
        do = "plug"
        joint = "knee"
        """,
        encoding="utf-8",
    )
    settings = ["board.1.clock.start_up_ms=100", "board.0.actuator.lag_ms=5"]
    settings += ["board.2.sensors.encoder_bits=12", "unattended.how=braked"]
    spool = RealtimeRobot(load(str(path), settings), QUIET).spool()
    happened = [(record.tick, event) for record in spool.ticks for event in record.events]
    what = {tag_of(event) for _, event in happened}
    assert {"sensor", "tipping", "plug", "ready", "admitted"} <= what
    (ready,) = [tick for tick, event in happened if isinstance(event, Ready)]
    assert ready == 900
    found = replay(spool)
    assert (found.differences, found.unplayed) == ((), 0)
