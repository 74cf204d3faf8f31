"""Boards that come and go, links that break, pushes: in the twin, tick by tick (S5 to S17)."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

from deploy.launch.twin import Twin, run_twin
from deploy.outcome.summary import summary
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import available, load
from plant_server.session.control import ONE_WAY_AFTER_TICKS
from plant_server.session.record import COMPLETE, FELL, Outcome, TickRecord, fall_line
from protocol.robot.events import Admission, Departure, Plug, Sides, Unplug, tag_of
from protocol.robot.scenario import Scenario, ScenarioError
from protocol.robot.states import State
from protocol.wire.frames import NO_TICK, TorqueFrame, decode

pytestmark = pytest.mark.slow

ANKLE, KNEE, HIP = range(3)
JOINTS = ("ankle", "knee", "hip")
DELAY_TICKS = 10
PERIOD_TICKS = 100
OUT, BACK = 230, 470
"""Ticks in which a board goes and comes."""


def scenario(*settings: str, source: str = "paper") -> Scenario:
    return load(source, ["run.duration_s=0.8", *settings])


def swapped(board: int, how: str, *settings: str) -> Scenario:
    """A board goes at `OUT` and comes back at `BACK`."""
    joint = JOINTS[board]
    events = (
        f"[{{at_s={OUT / 1000}, do='unplug', joint='{joint}'}},"
        f" {{at_s={BACK / 1000}, do='plug', joint='{joint}'}}]"
    )
    table = f"{{how='{how}', stiffness_nm_rad=100.0, damping_nm_s_rad=5.0}}"
    return scenario(f"event={events}", f"unattended={table}", *settings)


Run = tuple[list[TickRecord], Outcome]


@cache
def swap(board: int, how: str) -> Run:
    return run_twin(swapped(board, how))


def at(records: list[TickRecord], tick: int) -> TickRecord:
    (record,) = (record for record in records if record.tick == tick)
    return record


def said(records: list[TickRecord], board: int) -> Iterator[tuple[int, TorqueFrame | None]]:
    for record in records:
        answer = record.answers[board]
        yield record.tick, decode(TorqueFrame, answer) if answer else None


def events(records: list[TickRecord], *kinds: str) -> list[tuple[int, Any]]:
    return [(r.tick, event) for r in records for event in r.events if tag_of(event) in kinds]


BOARDS = pytest.mark.parametrize("board", [ANKLE, KNEE, HIP], ids=JOINTS)
HOWS = pytest.mark.parametrize("how", ["limp", "braked", "passive"])


@BOARDS
@HOWS
def test_s16_a_board_goes_and_comes_in_its_ticks_as_a_new_incarnation(board: int, how: str) -> None:
    records, _ = swap(board, how)
    for tick, frame in said(records, board):
        assert (frame is None) == (OUT <= tick < BACK)
        if frame is not None:
            assert frame.incarnation == (1 if tick < OUT else 2)
    others = [other for other in range(3) if other != board]
    assert all(f is not None and f.incarnation == 1 for o in others for _, f in said(records, o))
    assert events(records, "unplug", "gone", "plug", "admitted")[3:] == [
        (OUT, Unplug(board)),
        (OUT, Departure(board, "unplugged")),
        (BACK, Plug(board)),
        (BACK, Admission(board, 2)),
    ]


@BOARDS
@HOWS
def test_s17_the_joint_is_left_alone_until_the_new_board_drives(board: int, how: str) -> None:
    """The board is there from `BACK` on, and syncing for as long as its delay line fills."""
    records, _ = swap(board, how)
    drives = BACK + DELAY_TICKS
    alone = [record for record in records if OUT <= record.tick < drives]
    assert {record.torques_nm[board] for record in alone} == {0.0}
    angles = {record.angles_rad[board] for record in [*alone, at(records, drives)]}
    assert (len(angles) == 1) == (how == "braked")
    if how == "braked":
        assert {record.rates_rad_s[board] for record in alone} == {0.0}
    states = dict(said(records, board))
    for tick in range(BACK, drives):
        frame = states[tick]
        assert frame is not None
        assert (frame.state, frame.torque_nm) == (State.SYNCING, 0.0)
    assert at(records, drives).torques_nm[board] != 0.0
    assert at(records, drives + 2).rates_rad_s[board] != 0.0


def test_s17_what_a_brake_takes_from_the_body_is_recorded() -> None:
    """And a joint that is not braked takes nothing."""
    for how in ("limp", "braked", "passive"):
        lost = events(swap(HIP, how)[0], "energy_lost_j")
        if how != "braked":
            assert lost == []
            continue
        ((tick, loss),) = lost
        assert (tick, loss.board) == (OUT, HIP)
        assert loss.energy_j > 0.0


@BOARDS
def test_s11_a_new_board_is_disabled_until_an_election_enables_it(board: int) -> None:
    """Admitted after tick 0 it starts with y = 0; the next epoch is its first."""
    records, _ = swap(board, "braked")
    first_epoch = (BACK + DELAY_TICKS) // PERIOD_TICKS + 1
    latch = first_epoch * PERIOD_TICKS + 2
    frames = dict(said(records, board))
    for tick in range(BACK, latch):
        frame = frames[tick]
        assert frame is not None
        assert frame.enabled == 0
    for tick in range(latch, latch + 50):
        y = []
        for other in range(3):
            frame = dict(said([at(records, tick)], other))[tick]
            assert frame is not None
            assert frame.epoch == first_epoch
            y.append(frame.enabled)
        assert sum(y) == 1


def test_s11_the_new_board_is_heard_in_the_next_election() -> None:
    """With an error that is by far the largest it wins it, and nobody else does."""
    settings = (
        "event=[{at_s=0.230, do='unplug', joint='hip'},"
        " {at_s=0.46, do='reference', joint='hip', reference_deg=-40.0},"
        " {at_s=0.470, do='plug', joint='hip'}]"
    )
    records, _ = run_twin(scenario(settings, "unattended={how='braked'}"))
    for tick in (502, 550, 602):
        enabled = [dict(said([at(records, tick)], board))[tick] for board in range(3)]
        assert [frame.enabled for frame in enabled if frame is not None] == [0, 0, 1]


def test_a_new_board_gets_the_links_and_the_reference_of_today() -> None:
    """What was changed before and while it was away; each is a command in an observation."""
    twin = Twin(
        scenario(
            "event=[{at_s=0.1, do='faults', link='knee-hip', loss=0.25},"
            " {at_s=0.230, do='unplug', joint='hip'},"
            " {at_s=0.3, do='reference', joint='hip', reference_deg=5.0},"
            " {at_s=0.4, do='faults', link='knee-hip', delay_ms=2.0},"
            " {at_s=0.470, do='plug', joint='hip'}]",
            "unattended={how='braked'}",
        )
    )
    for record in twin.run():
        hip = twin.boards[HIP]
        if record.tick == BACK + DELAY_TICKS - 1:
            assert hip is not None
            assert hip.incarnation == 2
            (link,) = (hearing.link for hearing in hip.hearings)
            assert (link.parameters.loss, link.parameters.delay_ticks) == (0.25, 2.0)
            assert hip.reference_rad == np.radians(5.0)
            break


def test_s5_neighbours_hear_of_nobody_and_then_of_the_new_incarnation() -> None:
    """In the tick in which it is gone, and in which it comes; its first frame is one tick later."""
    twin = Twin(swapped(HIP, "braked"))
    knee = twin.boards[KNEE]
    assert knee is not None
    rosters, read = {}, knee.read

    def reads(payload: bytes) -> Any:
        observation = read(payload)
        rosters[observation.tick] = observation.neighbours[1][:2]
        return observation

    knee.read = reads  # type: ignore[method-assign]
    list(twin.run())
    assert rosters[OUT - 1] == (1, OUT - 2)
    assert all(rosters[tick][0] == 0 for tick in range(OUT, BACK))
    assert rosters[BACK] == (2, NO_TICK)
    assert rosters[BACK + 1] == (2, BACK)


def test_the_middle_board_out_makes_two_sides_from_its_tick_to_its_tick() -> None:
    records, _ = swap(KNEE, "braked")
    assert events(records, "sides") == [
        (OUT, Sides(((ANKLE,), (HIP,)))),
        (BACK, Sides(((ANKLE, KNEE, HIP),))),
    ]
    # Each side elects by itself: after the first election without the knee, both are enabled.
    for tick in (302, 402):
        y = [dict(said([at(records, tick)], board))[tick] for board in (ANKLE, HIP)]
        assert [frame.enabled for frame in y if frame is not None] == [1, 1]


def test_a_link_cut_both_ways_makes_two_sides_and_one_cut_one_way_does_not() -> None:
    cut = "{at_s=0.15, do='cut', link='knee-hip', duration_s=0.3}"
    records, _ = run_twin(scenario(f"event=[{cut}]"))
    assert events(records, "sides") == [
        (150, Sides(((ANKLE, KNEE), (HIP,)))),
        (450, Sides(((ANKLE, KNEE, HIP),))),
    ]
    one_way = cut.replace("duration_s", "one_way=true, duration_s")
    assert events(run_twin(scenario(f"event=[{one_way}]"))[0], "sides") == []


def test_s15_a_command_is_obeyed_in_the_tick_that_carries_it() -> None:
    """A cut at 150: the frame said in 149 is the first that is not used."""
    records, _ = run_twin(scenario("event=[{at_s=0.15, do='cut', link='all', duration_s=0.2}]"))
    for board in range(3):
        for tick, frame in said(records, board):
            assert frame is not None
            if tick > 0:
                heard = {use.heard_mask & 1 for use in frame.links}
                assert heard == {0 if 150 <= tick < 350 else 1}, (board, tick)


def test_a_push_acts_in_its_ticks_and_in_no_others() -> None:
    """From the tick in which it begins the body moves otherwise, so at the start of the next."""
    push = "event=[{at_s=0.3, do='push', segment='trunk', force_n=40.0, duration_s=0.05}]"
    twin, forces = Twin(scenario(push)), {}
    pushed = []
    for record in twin.run():
        forces[record.tick] = tuple(twin.lockstep.plant.body.forces_n)
        pushed.append(record)
    still, acting = (0.0, 0.0, 0.0), (0.0, 0.0, 40.0)
    assert all(force == (acting if 300 <= t < 350 else still) for t, force in forces.items())
    left, _ = run_twin(scenario())
    differ = [p.tick for p, r in zip(pushed, left, strict=True) if p.angles_rad != r.angles_rad]
    assert differ[0] == 301


@cache
def shipped(name: str) -> tuple[Scenario, list[TickRecord], Outcome, Trajectory]:
    whole = load(name)
    records, outcome = run_twin(whole)
    return whole, records, outcome, trajectory(whole, records, outcome)


@pytest.mark.parametrize("name", available())
def test_every_shipped_scenario_runs_to_its_end_and_can_be_summed_up(name: str) -> None:
    """Finite numbers, no refused answers, and only what is named for it falls."""
    whole, records, outcome, run = shipped(name)
    assert whole.description.endswith(".")
    assert outcome.ending == (FELL if name == "hotplug-limp" else COMPLETE)
    assert np.isfinite(run.angles_rad).all()
    assert np.isfinite(run.rates_rad_s).all()
    warm_up_ticks = max(board.lumped_delay_ticks for board in whole.boards)
    assert [r.tick for r in records] == list(range(-warm_up_ticks, outcome.tick))
    assert summary(run, mode="twin")["state_sha256"] == run.state_sha256


@pytest.mark.parametrize("name", ["lossy", "bursty", "one-way", "hotplug", "knee-out", "storm"])
def test_the_same_seed_gives_the_same_bytes(name: str) -> None:
    """Every answer of every board, faults, deaths and all."""
    _, records, outcome, _ = shipped(name)
    again, other = run_twin(load(name))
    assert again == records
    assert other._replace(wall_s=0.0) == outcome._replace(wall_s=0.0)


@pytest.mark.parametrize("name", ["lossy", "bursty", "storm"])
def test_another_seed_is_another_run_where_there_is_chance(name: str) -> None:
    first, second = (
        run_twin(load(name, ["run.duration_s=0.7", "event=[]", f"run.seed={seed}"]))[0]
        for seed in (1, 2)
    )
    heard = [
        [[use.heard_mask for use in f.links] for _, f in said(records, KNEE) if f is not None]
        for records in (first, second)
    ]
    assert heard[0] != heard[1]
    assert [r.angles_rad for r in first] != [r.angles_rad for r in second]


def test_hotplug_limp_falls_and_says_when_and_why() -> None:
    whole, _, outcome, _ = shipped("hotplug-limp")
    assert 3000 < outcome.tick < 5000
    line = fall_line(outcome, whole.run.tick_s)
    time_s = f"{outcome.tick / 1000:.2f}"
    assert line == f"fell at {time_s} s; hip had had no board since 3.00 s and was limp"


def test_hotplug_stands() -> None:
    """The survivors have lost the only IMU, and live by S9 for two seconds."""
    _, records, outcome, run = shipped("hotplug")
    assert outcome.undriven == ()
    assert events(records, "sides") == [
        (3000, Sides(((ANKLE, KNEE),))),
        (5000, Sides(((ANKLE, KNEE, HIP),))),
    ]
    knee = dict(said(records, KNEE))[4999]
    assert knee is not None
    assert knee.state == State.RECKONING
    last = dict(said(records, KNEE))[9999]
    assert last is not None
    assert last.state == State.RUNNING
    # It ends as upright as the paper's run, which nothing disturbs.
    _, _, _, undisturbed = shipped("paper")
    limit = np.abs(undisturbed.orientations_rad[-1]).max() + np.radians(1.0)
    assert np.abs(run.orientations_rad[-1]).max() < limit


def test_knee_out_has_two_sides_while_the_knee_is_out() -> None:
    _, records, _, _ = shipped("knee-out")
    assert events(records, "sides") == [
        (2000, Sides(((ANKLE,), (HIP,)))),
        (4000, Sides(((ANKLE, KNEE, HIP),))),
    ]


def test_blackout_has_two_sides_while_the_cable_is_cut() -> None:
    _, records, _, _ = shipped("blackout")
    assert events(records, "sides") == [
        (300, Sides(((ANKLE,), (KNEE, HIP)))),
        (1300, Sides(((ANKLE, KNEE, HIP),))),
    ]


def test_one_way_is_noticed_by_the_knee_that_is_not_heard() -> None:
    """By the echo of the ankle, for long enough that the status calls it a one-way link."""
    _, records, _, _ = shipped("one-way")
    for tick, frame in said(records, KNEE):
        assert frame is not None
        unheard = frame.links[0].unheard_ticks
        if 500 + ONE_WAY_AFTER_TICKS + 5 <= tick < 2500:
            assert unheard > ONE_WAY_AFTER_TICKS
        elif 0 <= tick < 500 or tick > 2510:
            assert unheard == 0


def test_s21_the_same_body_with_a_lower_bound_does_not_fall() -> None:
    """`run.fallen_below` is a matter of what one calls a fall."""
    settings = ["run.duration_s=4.0", "event=[{at_s=3.0, do='unplug', joint='hip'}]"]
    _, fell = run_twin(load("hotplug-limp", settings))
    _, stood = run_twin(load("hotplug-limp", [*settings, "run.fallen_below=0.5"]))
    assert (fell.ending, stood.ending) == (FELL, COMPLETE)


@pytest.mark.parametrize(
    ("bound", "complaint"),
    [
        ("0", "run.fallen_below: input should be greater than 0"),
        ("1", "run.fallen_below: input should be less than 1"),
        ("0.99", "below 0.99 of its upright height: the body has fallen before it begins"),
    ],
)
def test_a_bound_that_the_body_cannot_keep_is_refused(bound: str, complaint: str) -> None:
    with pytest.raises(ScenarioError, match=complaint):
        load("paper", [f"run.fallen_below={bound}"])
