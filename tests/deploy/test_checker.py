"""The checker of recordings: healthy runs pass, and whatever it claims, a lie about it is found."""

from collections.abc import Callable
from typing import Any

import pytest

from plant_server.session.record import TickRecord
from protocol.robot.events import Departure
from protocol.wire.frames import TorqueFrame, decode, encode
from tests.deploy.checker import BrokenRecordingError, check
from tests.deploy.spools import SHORT, bad_link, spool

TICK = 150
"""Within an epoch; the next one's urgencies are frozen in tick 200, and latched in 202."""


@pytest.mark.parametrize("name", SHORT)
def test_whatever_happens_to_a_run_its_recording_holds_together(name: str) -> None:
    assert check(spool(name)) >= (3 if name == "paper" else 0)


def test_every_epoch_of_a_healthy_run_is_claimed() -> None:
    assert check(spool("paper", "run.duration_s=1")) == 10
    assert check(spool("paper", "run.duration_s=1", "election.enabled=false")) == 0


def test_nothing_is_claimed_of_epochs_in_which_frames_were_late() -> None:
    assert check(bad_link(delay_ticks=1.0)) == 0


def said(**values: Any) -> Callable[[TickRecord], TickRecord]:
    def change(record: TickRecord) -> TickRecord:
        ankle, knee, hip = record.answers
        lie = encode(decode(TorqueFrame, knee)._replace(**values))
        return record._replace(answers=(ankle, lie, hip))

    return change


@pytest.mark.parametrize(
    ("tick", "change", "law"),
    [
        (TICK, lambda r: r._replace(tick=7), "gap-free"),
        (TICK, said(tick=TICK - 1), "of its tick"),
        (TICK, said(incarnation=2), "of who is there"),
        (TICK, lambda r: r._replace(answers=(b"", *r.answers[1:])), "who is there answers"),
        (TICK, lambda r: r._replace(events=(Departure(1, "died"),)), "of who is there"),
        (TICK, lambda r: r._replace(torques_nm=(1.0, *r.torques_nm[1:])), "living board said"),
        (TICK, lambda r: r._replace(torques_nm=(0.0, *r.torques_nm[1:])), "who drives is obeyed"),
        (-3, lambda r: r._replace(torques_nm=(1.0, 0.0, 0.0)), "living board said"),
        (202, said(enabled=1), "S13"),
    ],
)
def test_a_lie_is_found(tick: int, change: Callable[[TickRecord], TickRecord], law: str) -> None:
    of = spool()
    ticks = list(of.ticks)
    ticks[tick - ticks[0].tick] = change(ticks[tick - ticks[0].tick])
    with pytest.raises(BrokenRecordingError, match=law):
        check(of._replace(ticks=ticks))
