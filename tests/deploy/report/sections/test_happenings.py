from dataclasses import replace
from itertools import pairwise

import pytest

from deploy.recording.trajectory import Trajectory
from deploy.report.sections.happenings import HappeningKind, Span, timeline, told
from protocol.robot.events import (
    Admission,
    BoardFault,
    Departure,
    EnergyLoss,
    Event,
    Excuse,
    FreshTorque,
    LinkChange,
    LinkRepair,
    MidwayDeparture,
    Push,
    Ready,
    ReferenceChange,
    SensorFault,
    Sides,
    StaleTorque,
    Tipping,
    Unplug,
)
from protocol.robot.states import FaultCode, State
from tests.deploy.recordings import run

pytestmark = pytest.mark.slow


def lanes(trajectory: Trajectory) -> dict[str, list[Span]]:
    found: dict[str, list[Span]] = {}
    for span in timeline(trajectory):
        found.setdefault(span.lane, []).append(span)
    return found


@pytest.mark.parametrize("name", ["storm", "hotplug", "knee-out", "blackout", "one-way", "push"])
def test_spans_of_a_lane_follow_each_other_within_the_run(name: str) -> None:
    trajectory = run(name)
    found = lanes(trajectory)
    assert found
    for spans in found.values():
        assert all(0 <= span.first_tick <= span.end_tick <= trajectory.ticks for span in spans)
        assert all(one.end_tick <= other.first_tick for one, other in pairwise(spans))


def test_a_cut_ends_what_the_scenario_has_for_good_and_gives_it_back() -> None:
    spans = lanes(run("storm"))["knee-hip"]
    assert [(span.first_tick, span.end_tick, span.kind) for span in spans] == [
        (0, 800, HappeningKind.FAULTS),
        (800, 1000, HappeningKind.CUT),
        (1000, 10_000, HappeningKind.FAULTS),
    ]
    assert spans[0].label == spans[2].label
    assert "loss 0.1" in spans[0].label
    assert "delay 1 ms" in spans[0].label


def test_a_one_way_cut_has_a_lane_of_its_own() -> None:
    found = lanes(run("one-way"))
    assert [name for name in found if "→" in name] == ["knee → ankle"]


def test_what_is_true_of_all_links_is_one_lane() -> None:
    assert list(lanes(run("lossy"))) == ["all links"]


def test_a_joint_without_a_board_and_the_sides_that_it_leaves() -> None:
    found = lanes(run("knee-out"))
    away, syncing = found["knee"]
    assert (away.kind, away.first_tick, away.end_tick) == (HappeningKind.AWAY, 2000, 4000)
    assert (syncing.kind, syncing.first_tick) == (HappeningKind.SYNCING, 4000)
    (apart,) = found["cut apart"]
    assert (apart.first_tick, apart.end_tick, apart.label) == (2000, 4000, "ankle | hip")


def test_a_board_that_failed_says_with_which_code() -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    state = trajectory.state.copy()
    state[100:200, 2], state[200:300, 2], state[300:310, 2] = State.FAULT, 0, State.SYNCING
    state[400:, 2] = State.FAULT
    state[50:60, 1] = State.SAFE
    events: list[tuple[int, Event]] = [
        (100, BoardFault(2, FaultCode.CONTROLLER_NO_TORQUE, "no torque: nan")),
        (400, BoardFault(2, FaultCode.ELECTION_RAISED, "ValueError: no idea")),
    ]
    found = lanes(replace(trajectory, events=events, state=state))
    assert [(span.first_tick, span.end_tick, span.label) for span in found["hip"]] == [
        (100, 200, "fault 2: controller no torque"),
        (200, 300, "no board"),
        (300, 310, "filling its delay line"),
        (400, 500, "fault 3: election raised"),
    ]
    assert found["knee"] == [Span("knee", 50, 60, HappeningKind.SAFE, HappeningKind.SAFE)]


def test_what_is_bad_from_the_start_is_told_before_all_events() -> None:
    assert told(run("lossy")) == [(0, "all links, from the start: loss 0.2")]
    first, second, *_ = told(run("storm"))
    assert first.words.startswith("all links, from the start: loss 0.1, ")
    assert second == (800, "knee-hip: cut")


def test_a_run_that_was_cut_short_says_how_it_ended() -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    assert told(replace(trajectory, ending="fell"))[-1] == (500, "the run ended: fell")


def test_healing_ends_faults_for_good() -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    events: list[tuple[int, Event]] = [
        (100, LinkChange(((0, 1),), {"loss": 0.5})),
        (200, LinkChange((), {"delay_ticks": 3.0})),
        (300, LinkRepair(())),
    ]
    spans = timeline(replace(trajectory, events=events))
    assert [(span.lane, span.first_tick, span.end_tick, span.label) for span in spans] == [
        ("ankle → knee", 100, 200, "loss 0.5"),
        ("ankle → knee", 200, 300, "loss 0.5, delay 3 ms"),
        ("knee → ankle", 200, 300, "delay 3 ms"),
        ("knee-hip", 200, 300, "delay 3 ms"),
    ]


def test_a_sensor_fails_until_its_time_is_over_or_another_command_comes() -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    events: list[tuple[int, Event]] = [
        (100, SensorFault(1, "encoder", "stuck", 0.0, 50)),
        (200, SensorFault(0, "encoder", "off", 0.0, 0)),
        (300, SensorFault(0, "all", "garbage", 0.0, 0)),
        (400, SensorFault(0, "encoder", "ok", 0.0, 0)),
        (450, SensorFault(2, "imu", "slow", 20.0, 900)),
    ]
    spans = timeline(replace(trajectory, events=events))
    assert [(span.lane, span.first_tick, span.end_tick, span.label) for span in spans] == [
        ("knee sensors", 100, 150, "encoder stuck"),
        ("ankle sensors", 200, 300, "encoder off"),
        ("ankle sensors", 300, 400, "all of them garbage"),
        ("hip sensors", 450, 500, "imu slow"),
    ]


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (LinkChange(((0, 1), (1, 0)), {"cut": 1.0}), "ankle-knee: cut"),
        (LinkChange(((2, 1),), {"cut": 0.0}), "hip → knee: end of cut"),
        (LinkChange((), {"loss": 0.2, "jitter_ticks": 2.0}), "all links: loss 0.2, jitter 2 ms"),
        (LinkRepair(()), "all links: perfect again"),
        (Push(2, -40.0, 100), "trunk: pushed with -40 N for 100 ms"),
        (ReferenceChange(1, 0.05235987755982988), "knee: reference 3°"),
        (Unplug(1), "knee: command unplug"),
        (Departure(1, "died"), "knee: gone: died"),
        (MidwayDeparture(1, "died"), "knee: gone in the middle of the tick: died"),
        (Admission(1, 2), "knee: admitted, incarnation 2"),
        (EnergyLoss(1, 0.125), "knee: joint braked, which took 0.125 J"),
        (Sides(((0,), (2,))), "cut apart: ankle | hip"),
        (Sides(()), "connected: no board"),
        (Sides(((0, 1, 2),)), "connected: ankle, knee, hip"),
        (Ready(1), "knee: has started up"),
        (SensorFault(1, "encoder", "stuck", 0.0, 60), "knee: sensor encoder is stuck for 60 ms"),
        (SensorFault(1, "imu", "off", 0.0, 0), "knee: sensor imu is off"),
        (SensorFault(1, "all", "off", 0.0, 60), "knee: all sensors are off for 60 ms"),
        (StaleTorque(1), "knee: its torque is too old, so 0 N m are applied"),
        (FreshTorque(1), "knee: a new torque has come"),
        (SensorFault(1, "encoder", "ok", 0.0, 0), "knee: sensor encoder is whole again"),
        (Tipping(begins=True), "the foot begins to tip"),
        (Tipping(begins=False), "the foot is flat again"),
        (Excuse(0, 1), "knee: goes on without a frame of ankle"),
        (
            BoardFault(1, FaultCode.CONTROLLER_RAISED, "ValueError: no\nmine.py:5 in torque_nm"),
            "knee: fault 1 (controller raised): ValueError: no; mine.py:5 in torque_nm",
        ),
    ],
)
def test_every_event_is_told_in_words(event: Event, words: str) -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    (found,) = told(replace(trajectory, events=[(7, event)]))
    assert found == (7, words)


def test_boards_that_were_there_from_the_start_are_not_news() -> None:
    trajectory = run("paper", "run.duration_s=0.5")
    assert trajectory.events
    assert told(trajectory) == []
