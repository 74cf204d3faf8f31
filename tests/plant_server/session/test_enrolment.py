"""Enrolment: one driver for each joint, and a reason for everybody else (S2)."""

from itertools import product
from typing import Any

import pytest

from plant_server.session.enrolment import Enrolment
from protocol.robot.scenario import run_id
from protocol.wire.enrolment import EnrolmentReply, EnrolmentRequest, EnrolmentVerdict
from protocol.wire.frames import VERSION

DIGEST, OTHER = b"\x11" * 32, b"\x22" * 32
RUN = run_id(DIGEST)
JOINTS = ["ankle", "knee", "hip"]
ANKLE, KNEE, HIP = range(3)
BOOTS = (0xA, 0xB, 0xC)
BELOW, ABOVE = 1, 2
"""Bits of `links_up` of the board in the middle."""


def request(
    board: int, boot: int | None = None, links_up: int = 0, former_run: int = 0
) -> EnrolmentRequest:
    return EnrolmentRequest(
        version=VERSION,
        rig="robot",
        joint=JOINTS[board],
        incarnation=0,
        scenario_digest=DIGEST,
        boot=BOOTS[board] if boot is None else boot,
        links_up=links_up,
        former_run=former_run,
        mass_kg=10.0,
        length_m=0.5,
        com_m=0.25,
        inertia_kg_m2=0.2,
    )


def enrolment() -> Enrolment:
    return Enrolment(rig="robot", joints=JOINTS, digest=DIGEST)


def accepted(incarnation: int) -> EnrolmentReply:
    return EnrolmentReply(VERSION, EnrolmentVerdict.ACCEPTED, "", RUN, incarnation)


REFUSALS: list[tuple[dict[str, Any], EnrolmentVerdict, tuple[str, str]]] = [
    ({"version": 99}, EnrolmentVerdict.WRONG_VERSION, ("99", str(VERSION))),
    ({"rig": "other"}, EnrolmentVerdict.WRONG_RIG, ("'other'", "'robot'")),
    ({"joint": "elbow"}, EnrolmentVerdict.UNKNOWN_JOINT, ("'elbow'", "ankle, knee, hip")),
    (
        {"scenario_digest": OTHER},
        EnrolmentVerdict.OTHER_SCENARIO,
        (OTHER.hex()[:12], DIGEST.hex()[:12]),
    ),
    ({"boot": 0xF}, EnrolmentVerdict.JOINT_TAKEN, (f"{0xF:016x}", f"{BOOTS[KNEE]:016x}")),
]


@pytest.mark.parametrize(("wrong", "verdict", "sides"), REFUSALS, ids=lambda x: str(x)[:24])
def test_a_refusal_has_its_verdict_and_names_both_sides(
    wrong: dict[str, Any], verdict: EnrolmentVerdict, sides: tuple[str, str]
) -> None:
    """And leaves no trace: the one who holds the joint goes on."""
    desk = enrolment()
    desk.decide(request(KNEE, links_up=BELOW))
    before = [repr(seat) for seat in desk.seats]
    reply = desk.decide(request(KNEE, links_up=ABOVE)._replace(**wrong))
    assert (reply.version, reply.verdict, reply.incarnation) == (VERSION, verdict, 0)
    assert all(side in reply.reason for side in sides)
    assert [repr(seat) for seat in desk.seats] == before
    assert desk.decide(request(KNEE, links_up=BELOW)) == accepted(1)


def test_the_first_thing_that_does_not_fit_is_the_verdict() -> None:
    """Another version may mean anything by the rest; another rig has other joints."""
    wrong: dict[str, Any] = {}
    for change, verdict, _ in reversed(REFUSALS):
        wrong |= change
        desk = enrolment()
        desk.decide(request(KNEE))
        asked = request(KNEE)._replace(**wrong)
        assert desk.decide(asked).verdict == verdict


def test_every_verdict_of_a_plant_that_runs_has_been_seen() -> None:
    seen = {verdict for _, verdict, _ in REFUSALS} | {EnrolmentVerdict.ACCEPTED}
    assert seen == set(EnrolmentVerdict) - {EnrolmentVerdict.RUN_OVER}


def test_asking_again_is_harmless() -> None:
    """It tells the plant which links are up, and is told the same."""
    desk = enrolment()
    for links_up in (0, BELOW, BELOW | ABOVE, BELOW):
        assert desk.decide(request(KNEE, links_up=links_up)) == accepted(1)
        assert desk.seats[KNEE].links_up == links_up


def test_incarnations_are_counted_for_each_joint() -> None:
    """So they do not depend on who came first, and no earlier one ever comes back."""
    desk = enrolment()
    assert [desk.decide(request(board)) for board in (HIP, ANKLE, KNEE)] == [accepted(1)] * 3
    for incarnation, boot in enumerate((0x20, 0x21, BOOTS[HIP]), start=2):
        holder = desk.seats[HIP].boot
        assert holder is not None
        assert desk.gone(HIP, holder)
        assert desk.decide(request(HIP, boot)) == accepted(incarnation)
    assert desk.decide(request(ANKLE)) == accepted(1)


def test_only_the_end_of_the_one_who_holds_a_joint_frees_it() -> None:
    """A process that was refused, or given up, ends too; and a late word of it changes nothing."""
    desk = enrolment()
    desk.decide(request(KNEE, links_up=BELOW))
    assert not desk.gone(KNEE, 0xF)
    assert desk.decide(request(KNEE, 0xF)).verdict == EnrolmentVerdict.JOINT_TAKEN
    assert desk.gone(KNEE, BOOTS[KNEE])
    assert not desk.gone(KNEE, BOOTS[KNEE])
    assert (desk.seats[KNEE].boot, desk.seats[KNEE].links_up) == (None, 0)


def test_a_dismissed_board_may_enrol_again_as_another_incarnation() -> None:
    """The same boot: a process that was stopped and goes on."""
    desk = enrolment()
    desk.decide(request(KNEE, links_up=BELOW | ABOVE))
    desk.dismiss(KNEE)
    assert not desk.linked(KNEE)
    assert not desk.gone(KNEE, BOOTS[KNEE])  # It held nothing any more.
    assert desk.decide(request(KNEE)) == accepted(2)
    assert desk.decide(request(KNEE)) == accepted(2)


def test_a_joint_that_was_given_to_another_is_taken_for_the_dismissed() -> None:
    desk = enrolment()
    desk.decide(request(KNEE))
    desk.dismiss(KNEE)
    assert desk.decide(request(KNEE, 0x20)) == accepted(2)
    assert desk.decide(request(KNEE)).verdict == EnrolmentVerdict.JOINT_TAKEN


@pytest.mark.parametrize("up", list(product((0, 1), repeat=4)), ids=str)
def test_a_board_is_linked_when_it_hears_and_is_heard(up: tuple[int, ...]) -> None:
    """By each of its neighbours, in both directions; other links are the affair of others."""
    ankle_up, below_up, above_up, hip_up = up
    desk = enrolment()
    desk.decide(request(ANKLE, links_up=ankle_up))
    desk.decide(request(KNEE, links_up=below_up * BELOW | above_up * ABOVE))
    desk.decide(request(HIP, links_up=hip_up))
    assert desk.linked(ANKLE) == (ankle_up and below_up)
    assert desk.linked(HIP) == (above_up and hip_up)
    assert desk.linked(KNEE) == all(up)


def test_whoever_is_absent_is_not_asked() -> None:
    """A board whose neighbours are not there has nobody to be linked with, but has to be there."""
    desk = enrolment()
    assert not desk.linked(KNEE)
    desk.decide(request(KNEE))
    assert desk.linked(KNEE)
    desk.decide(request(HIP, links_up=1))
    assert not desk.linked(KNEE)
    desk.decide(request(KNEE, links_up=ABOVE))
    assert desk.linked(KNEE)
    assert desk.gone(HIP, BOOTS[HIP])
    desk.decide(request(KNEE, links_up=0))
    assert desk.linked(KNEE)


def test_a_robot_of_one_joint_has_no_links() -> None:
    desk = Enrolment(rig="robot", joints=["ankle"], digest=DIGEST)
    desk.decide(request(ANKLE))
    assert desk.linked(ANKLE)


def test_a_run_has_another_name_than_the_one_that_its_boards_come_from() -> None:
    """The plant was started again, two of its boards outlived it: nothing of before may fit."""
    plant = enrolment()
    assert plant.decide(request(KNEE)).run_id == RUN
    assert plant.decide(request(HIP, former_run=RUN)).run_id == RUN + 1
    assert plant.decide(request(ANKLE, former_run=RUN)).run_id == RUN + 1
    assert not plant.linked(KNEE), "it has been told of the run before"
    assert plant.decide(request(KNEE)).run_id == RUN + 1


def test_a_run_that_has_begun_keeps_its_name() -> None:
    """A board that was given up on enrols again, and comes from this very run."""
    plant = enrolment()
    plant.decide(request(KNEE))
    plant.begun = True
    plant.dismiss(KNEE)
    assert plant.decide(request(KNEE, former_run=RUN)).run_id == RUN
