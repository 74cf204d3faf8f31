"""A link's mailbox in realtime: the latest wins, nobody is trusted, faults are as in lockstep."""

from itertools import permutations
from typing import Any

import pytest

from module_agent.firmware.link_model import LinkModel
from module_agent.firmware.own_time.mailbox import FRAMES_MAX, STALE_PERIODS, Mailbox
from module_agent.firmware.own_time.translator import OwnTime
from protocol.robot.cadence import Cadence
from protocol.robot.events import PERFECT, LinkParameters
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame, Neighbour, Reason, encode
from protocol.wire.trace import TakenFrames, TickTrace
from protocol.wire.trace_differences import TraceWriter, decode_trace
from tests.module_agent.robot import config

RUN = 2**31 + 7
OWN, SENDERS = 2, 4
"""Plant ticks per period, of the board and of its neighbour."""
AHEAD = 16
THERE = Neighbour(1, NO_TICK, 0)


def mailbox(
    parameters: LinkParameters = PERFECT,
    *,
    own: int = OWN,
    senders: int = SENDERS,
    ahead: int = AHEAD,
) -> Mailbox:
    link = LinkModel(seed=1, sender=1, receiver=0, standing=parameters)
    cadence = Cadence((own, senders, senders), 8, 0, ahead, 40, catches_up=False)
    return Mailbox(link, OwnTime(config(0, cadence=cadence)), run_id=RUN, boards=3)


def frame(tick: int, **changes: Any) -> bytes:
    plain = LinkFrame(
        RUN, 1, tick, NO_TICK, NO_EPOCH, 0, 0.0, 1, tick, 0.1, 0.2, 3.0, 0.1, 0.2, 0.3, 0.4
    )
    return encode(plain._replace(**changes))


def heard(box: Mailbox, slot: int, neighbour: Neighbour = THERE) -> list[int]:
    return [one.tick for one in box.take(slot, neighbour)]


def test_each_frame_is_heard_once_and_the_newest_last() -> None:
    box = mailbox()
    for tick in (8, 0, 4):
        box.put(frame(tick))
    assert heard(box, 5) == [0, 4, 8]
    assert heard(box, 6) == []
    assert box.newest_tick == 8
    assert not box.refused


@pytest.mark.parametrize("order", sorted(set(permutations((0, 4, 8, 4)))))
def test_order_and_doubles_change_nothing(order: tuple[int, ...]) -> None:
    box = mailbox()
    for tick in order:
        box.put(frame(tick))
    assert heard(box, 5) == [0, 4, 8]
    assert not box.refused


def test_what_was_overtaken_is_dropped_and_nobody_is_to_blame() -> None:
    box = mailbox()
    box.put(frame(8))
    assert heard(box, 5) == [8]
    box.put(frame(4))
    assert heard(box, 6) == []
    assert not box.refused


def test_it_says_which_frames_it_took() -> None:
    """For the trace: whoever plays the run again puts in the same ones."""
    box = mailbox()
    assert box.taken == TakenFrames(NO_TICK, 0)
    for tick in (0, 8, 12):
        box.put(frame(tick))
    heard(box, 6)
    assert box.taken == TakenFrames(12, 0b101)
    heard(box, 7)
    assert box.taken == TakenFrames(12, 0)


def test_a_storm_leaves_the_newest_few() -> None:
    box = mailbox()
    for tick in range(0, 4000, 4):
        box.put(frame(tick))
    assert heard(box, 2000) == [3996 - 4 * n for n in reversed(range(FRAMES_MAX))]


def test_samples_come_in_own_periods_the_nearest_one() -> None:
    box = mailbox(senders=1)
    for tick, nearest in ((4, 2), (5, 3), (6, 3), (7, 4)):
        box.put(frame(tick))
        assert [one.sample_tick for one in box.take(4, THERE)] == [nearest]
    box.put(frame(8, sample_tick=NO_TICK))
    assert [one.sample_tick for one in box.take(4, THERE)] == [NO_TICK]


def test_how_long_the_neighbour_has_not_heard_is_in_own_periods() -> None:
    box = mailbox()
    box.put(frame(40, heard_tick=20))
    heard(box, 20)
    assert box.unheard_ticks == 9, "slot 10 was heard, slot 19 could have been"
    box.put(frame(44))
    heard(box, 22)
    assert box.unheard_ticks == 255, "it has heard nothing ever"


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", Reason.SIZE),
        (frame(4)[:-1] + b"\x00", Reason.CORRUPT),
        (frame(4, run_id=RUN + 1), Reason.RUN),
        (frame(4, incarnation=0), Reason.INCARNATION),
        (frame(4, urgency=-1.0), Reason.RANGE),
        (frame(4, com_x_m=float("nan")), Reason.RANGE),
        (frame(5), Reason.TICK),
        (frame(10 * OWN + AHEAD + 4), Reason.TICK),
        (frame(10 * OWN - STALE_PERIODS * SENDERS - 4), Reason.TICK),
    ],
    ids=["size", "crc", "run", "nobody", "w", "nan", "no-period", "future", "backlog"],
)
def test_what_cannot_be_used_is_counted_and_no_data(payload: bytes, reason: Reason) -> None:
    box = mailbox()
    box.put(payload)
    assert heard(box, 10) == []
    assert dict(box.refused) == {reason: 1}
    box.put(frame(16))
    assert heard(box, 11) == [16], "the next is heard all the same"


def test_a_new_board_at_the_other_end_begins_anew() -> None:
    box = mailbox()
    box.put(frame(8))
    box.put(frame(12, incarnation=2))
    assert heard(box, 6) == [8], "the roster names the first one still"
    box.put(frame(16))
    assert heard(box, 7, Neighbour(2, NO_TICK, 0)) == [12]
    box.put(frame(20))
    assert heard(box, 8, Neighbour(2, NO_TICK, 0)) == []
    assert box.refused == {Reason.INCARNATION: 1}


def test_nobody_is_heard_who_is_not_on_the_roster() -> None:
    box = mailbox()
    for incarnation in range(1, 20):
        box.put(frame(8, incarnation=incarnation))
    assert heard(box, 5, Neighbour(0, NO_TICK, 0)) == []
    assert len(box._arrived) <= 2, "and takes no room"


def test_loss_and_delay_are_drawn_as_in_lockstep() -> None:
    """For each frame once, from its tick; late ones by whole periods, rounded up."""
    lossy, model = mailbox(LinkParameters(loss=0.5)), mailbox(LinkParameters(loss=0.5)).link
    for tick in range(0, 400, 4):
        lossy.put(frame(tick))
        assert heard(lossy, tick // OWN + 1) == ([tick] if model.fate(tick).late_ticks else [])
    late = mailbox(LinkParameters(delay_ticks=3.0))
    late.put(frame(40))
    assert [heard(late, slot) for slot in (20, 21, 22, 23)] == [[], [], [40], []]
    assert late.taken.newest_tick == 40


def test_a_cut_link_and_flipped_bits() -> None:
    cut, damaged = mailbox(LinkParameters(cut=1.0)), mailbox(LinkParameters(corrupt=1.0))
    for box in (cut, damaged):
        box.put(frame(40))
        assert heard(box, 20) == []
    assert not cut.refused
    assert damaged.refused == {Reason.CORRUPT: 1}


def test_the_warm_up_knows_no_faults() -> None:
    box = mailbox(LinkParameters(cut=1.0))
    box.put(frame(-8))
    assert heard(box, -3) == [-8]


@pytest.mark.parametrize("apart", [1, 63, 64, 500, 3000])
def test_what_is_far_apart_is_not_taken_together(apart: int) -> None:
    """On a host that is far too slow a neighbour can be far ahead; the trace has to hold it."""
    box = mailbox(ahead=10**5)
    for tick in (0, apart * SENDERS):
        box.put(frame(tick))
    together = apart <= 63
    assert heard(box, 5) == [0, apart * SENDERS][not together :]
    assert box.refused[Reason.TICK] == (not together)
    writer = TraceWriter(run_id=RUN, incarnation=1, links=1)
    writer.add(TickTrace(5, 0, 0, 0, 0, 0, 0, 0, (box.taken,)))
    payload = writer.flush()
    assert payload is not None
    assert decode_trace(payload).lived[0].taken == (box.taken,)
