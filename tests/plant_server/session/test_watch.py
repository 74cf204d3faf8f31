"""What the plant's process notices beside the run, and tells whoever asks how the robot is."""

import json
from typing import Any
from zlib import decompress

import msgpack

from plant_server.session.control import STATUS, answer
from plant_server.session.lockstep import Lockstep
from plant_server.session.watch import ENROLMENT_REQUESTS, PlantWatch
from protocol.robot.states import COUNTERS
from protocol.wire.frames import VERSION, Fault, Reason, encode, seal
from tests.plant_server.plant import (
    ANKLE,
    HIP,
    JOINTS,
    KNEE,
    RUN,
    finish,
    opened,
    plant,
    play,
    torque_frame,
)


def told(lockstep: Lockstep, watch: PlantWatch) -> dict[str, Any]:
    """The status, as a terminal gets it."""
    request = seal(msgpack.packb((VERSION, STATUS)))
    found: dict[str, Any] = json.loads(
        decompress(answer(lockstep, list(JOINTS), request, watch=watch))
    )
    return found


def test_a_board_that_is_let_in_enrols_until_it_has_answered() -> None:
    lockstep, watch = plant(here=(ANKLE,)), PlantWatch(list(JOINTS))
    watch.enrolled = {ANKLE, KNEE}
    states = [board["state"] for board in told(lockstep, watch)["boards"]]
    assert states == ["enrolling", "enrolling", "absent"]
    play(lockstep)
    states = [board["state"] for board in told(lockstep, watch)["boards"]]
    assert states == ["running", "enrolling", "absent"]


def test_counters_failures_and_boards_that_hang_are_told() -> None:
    lockstep, watch = plant(), PlantWatch(list(JOINTS))
    opened(lockstep)
    lockstep.report(KNEE, encode(Fault(RUN, 1, 0, 4, 0, 1, "vote answered a NoneType\nwhere")))
    place = COUNTERS.index("refused_tick")
    counted = torque_frame(0, board=HIP)._replace(counter=place, counted=17)
    lockstep.answer(HIP, encode(counted))
    finish(lockstep)
    watch.stuck[ANKLE] += 2
    ankle, knee, hip = told(lockstep, watch)["boards"]
    assert (ankle["stuck"], knee["stuck"], hip["stuck"]) == (2, 0, 0)
    assert ankle["fault"] is hip["fault"] is None
    text = "vote answered a NoneType\nwhere"
    assert knee["fault"] == {"code": 4, "name": "election no vote", "text": text}
    assert list(hip["counters"]) == list(COUNTERS)
    assert {name: count for name, count in hip["counters"].items() if count} == {"refused_tick": 17}


def test_a_storm_may_be_of_what_the_plant_refuses_or_of_what_a_board_tells_it_refuses() -> None:
    lockstep, watch = plant(), PlantWatch(list(JOINTS))
    assert watch.look(10.0, lockstep.plant) == []
    for _ in range(2000):
        lockstep.plant.refuse(HIP, Reason.CORRUPT)
        watch.count(ENROLMENT_REQUESTS, Reason.SIZE)
        watch.count("reports of knee", Reason.MALFORMED)
    opened(lockstep)
    place = COUNTERS.index("refused_range")
    counted = torque_frame(0, board=KNEE)._replace(counter=place, counted=3000)
    lockstep.answer(KNEE, encode(counted))
    finish(lockstep)
    expected = {
        ("frames of hip", 2000.0, Reason.CORRUPT),
        ("frames to knee", 3000.0, Reason.RANGE),
        (ENROLMENT_REQUESTS, 2000.0, Reason.SIZE),
    }
    assert set(watch.look(11.0, lockstep.plant)) == expected, "reports were not known before"
    assert {tuple(storm.values()) for storm in told(lockstep, watch)["storms"]} == expected
    assert watch.look(12.0, lockstep.plant) == []
    assert told(lockstep, watch)["storms"] == []
