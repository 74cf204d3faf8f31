"""A replay is the run again, whatever happened to it; and one changed bit is found where it is."""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest

from deploy.recording.differences import NOTHING, REFUSED, Difference, first_difference
from plant_server.session.record import FELL, Outcome, TickRecord
from plant_server.spool.spool import Spool
from protocol.robot.events import (
    Admission,
    Departure,
    Event,
    Excuse,
    LinkChange,
    MidwayDeparture,
    Push,
    ReferenceChange,
    SensorFault,
    Sides,
    tag_of,
)
from protocol.wire.frames import TorqueFrame, decode, encode
from tests.deploy.spools import SHORT, spool
from tests.sim.plans import plan
from tests.sim.robot import Robot

pytestmark = pytest.mark.slow


def replayed(of: Spool) -> Difference | None:
    played: list[int] = []
    found = first_difference(of, played.append)
    assert played == [record.tick for record in of.ticks][: len(played)]
    assert (len(played) == len(of.ticks)) or found is not None
    return found


@pytest.mark.parametrize("name", SHORT)
def test_s19_a_replay_is_the_run_to_the_bit(name: str) -> None:
    assert replayed(spool(name)) is None


def test_a_fall_is_replayed_to_the_ground() -> None:
    fallen = spool("paper", "board.0.servo.kp_nm_rad=0")
    assert fallen.outcome is not None
    assert fallen.outcome.ending == FELL
    assert replayed(fallen) is None


@pytest.mark.parametrize("seed", range(40))
def test_any_death_at_any_moment_is_replayed(seed: int) -> None:
    """The hunt's robot: boards die in the middle of a tick, freeze, come back unasked; frames are
    not waited for; links do what they can; and a network brings doubles, old frames and noise.

    Blind sensors alone are left out: they are the board's, and nobody records them.
    """
    drawn = plan(seed)
    robot = Robot(drawn._replace(rates=drawn.rates._replace(blindness=0.0)))
    ticks = [robot.tick() for _ in range(drawn.faulty_ticks)]
    recorded = spool()._replace(
        scenario=drawn.scenario,
        ticks=ticks,
        walls=[None] * len(ticks),
        outcome=robot.twin.lockstep.plant.outcome(0.0, "stopped"),
    )
    assert replayed(recorded) is None


def test_the_hunt_does_what_a_replay_has_to_cope_with() -> None:
    """Else the test above would prove nothing."""
    seen = set()
    for seed in range(40):
        drawn = plan(seed)
        robot = Robot(drawn._replace(rates=drawn.rates._replace(blindness=0.0)))
        for _ in range(drawn.faulty_ticks):
            seen |= {tag_of(event) for event in robot.tick().events}
    commands = {"link", "heal", "reference", "push", "unplug", "plug"}
    assert seen >= commands | {"admitted", "gone", "gone_midway", "excused", "energy_lost_j"}


def changed(of: Spool, tick: int, change: Callable[[TickRecord], TickRecord]) -> Spool:
    ticks = list(of.ticks)
    index = tick - ticks[0].tick
    ticks[index] = change(ticks[index])
    return of._replace(ticks=ticks)


def in_frame(**values: Any) -> Callable[[TickRecord], TickRecord]:
    """Change fields of the knee's answer."""

    def change(record: TickRecord) -> TickRecord:
        ankle, knee, hip = record.answers
        frame = decode(TorqueFrame, knee)._replace(**values)
        return record._replace(answers=(ankle, encode(frame), hip))

    return change


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda r: r._replace(angles_rad=(*r.angles_rad[:2], 0.5)), "angles_rad of hip"),
        (lambda r: r._replace(rates_rad_s=(-0.0, *r.rates_rad_s[1:])), "rates_rad_s of ankle"),
        (lambda r: r._replace(torques_nm=(nan, *r.torques_nm[1:])), "torques_nm of ankle"),
        (lambda r: r._replace(events=(Departure(1, "died"),)), "event"),
        (lambda r: r._replace(events=(Sides(((0,), (1, 2))),)), "event"),
        (lambda r: r._replace(answers=(*r.answers[:2], b"")), "torque frame of hip"),
        (lambda r: r._replace(answers=(*r.answers[:2], r.answers[2][:-1])), "torque frame of hip"),
        (in_frame(torque_nm=1.0), "torque_nm of the torque frame of knee"),
        (in_frame(state=3), "state of the torque frame of knee"),
        (in_frame(urgency=nan), "urgency of the torque frame of knee"),
        (in_frame(links=()), "links[0] of the torque frame of knee"),
    ],
)
def test_a_changed_value_is_found_in_its_tick(
    change: Callable[[TickRecord], TickRecord], what: str
) -> None:
    found = replayed(changed(spool(), 0, change))
    assert found is not None
    assert found.tick == 0
    assert found.what.startswith(what)
    assert repr(found.recorded) != repr(found.replayed)
    assert str(found).startswith(f"tick 0: {what}")


def test_one_last_bit_is_enough() -> None:
    def change(record: TickRecord) -> TickRecord:
        angle_rad = record.angles_rad[1]
        assert angle_rad * (1.0 + 2.0**-52) != angle_rad
        angles = (record.angles_rad[0], angle_rad * (1.0 + 2.0**-52), record.angles_rad[2])
        return record._replace(angles_rad=angles)

    found = replayed(changed(spool(), 123, change))
    assert found is not None
    assert (found.tick, found.what) == (123, "angles_rad of knee")


def test_a_tick_that_is_missing_is_found() -> None:
    whole = spool()
    found = replayed(whole._replace(ticks=whole.ticks[:50] + whole.ticks[51:]))
    assert found is not None
    assert (found.what, found.recorded, found.replayed) == ("tick", 41, 40)


@pytest.mark.parametrize(
    "event",
    [
        Admission(9, 1),
        MidwayDeparture(9, "died"),
        Excuse(0, 5),
        Push(3, 5.0, 1),
        Push(2, nan, 1),
        LinkChange(((0, 2),), {"loss": 1.0}),
        LinkChange((), {}),
        SensorFault(5, "all", "off", 0.0, 1),
        ReferenceChange(1, 4.0),
    ],
)
def test_an_event_that_cannot_have_been_is_named(event: Event) -> None:
    found = replayed(changed(spool(), 20, lambda record: record._replace(events=(event,))))
    assert found is not None
    assert (found.tick, found.replayed) == (20, NOTHING)
    assert found.what.startswith("event")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"angles_rad": (0.0, 0.0, 0.0)}, "angles_rad of the outcome"),
        ({"ending": FELL}, "ending of the outcome"),
        ({"tick": 299}, "tick of the outcome"),
    ],
)
def test_how_it_ended_is_compared_too(change: dict[str, object], what: str) -> None:
    outcome = spool().outcome
    assert outcome is not None
    found = replayed(spool()._replace(outcome=Outcome(**{**outcome._asdict(), **change})))
    assert found is not None
    assert found.what == what


def test_a_run_that_did_not_come_to_its_end_cannot_say_that_it_did() -> None:
    whole = spool()
    half = whole.ticks[:160]
    at_half = whole.ticks[160]
    assert whole.outcome is not None
    outcome = whole.outcome._replace(
        tick=at_half.tick, angles_rad=at_half.angles_rad, rates_rad_s=at_half.rates_rad_s
    )
    found = replayed(whole._replace(ticks=half, outcome=outcome))
    assert found is not None
    assert found.what == "the run is over"
    assert replayed(whole._replace(ticks=half, outcome=outcome._replace(ending="stopped"))) is None
    assert replayed(whole._replace(ticks=half, outcome=None)) is None


def test_what_a_network_brought_is_not_compared() -> None:
    """Counts of refused frames differ from run to run; all other counts do not."""
    for tick in range(14):
        frame = decode(TorqueFrame, spool().ticks[tick + 10].answers[1])
        found = replayed(changed(spool(), tick, in_frame(counted=frame.counted + 3)))
        assert (found is None) == (frame.counter in REFUSED)
