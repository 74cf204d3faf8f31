"""Hearing one neighbour: said in k, heard in k+1, and never from the wrong sender (S1, S4, S5)."""

import random
from math import inf, nan
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.hearing import Hearing
from module_agent.firmware.link_model import LinkModel
from protocol.robot.events import PERFECT, LinkParameters
from protocol.wire.frames import (
    NO_TICK,
    End,
    LinkFrame,
    Neighbour,
    Reason,
    encode,
    seal,
)

LAW = settings(max_examples=150, deadline=None, derandomize=True)
RUN = 2**31 + 5
BOARDS = 3
INCARNATION = 4
SAID = LinkFrame(RUN, INCARNATION, 0, -1, 0, 1, 0.5, 2, -1, -0.1, 0.0, 40.0, 0.1, 0.6, 0.01, 0.02)


def link(standing: LinkParameters = PERFECT) -> LinkModel:
    return LinkModel(seed=3, sender=1, receiver=0, standing=standing)


def hearing(standing: LinkParameters = PERFECT) -> Hearing:
    return Hearing(link(standing), run_id=RUN, boards=BOARDS)


def frame(tick: int, **changes: Any) -> LinkFrame:
    return SAID._replace(tick=tick, **changes)


def there(completed_tick: int, incarnation: int = INCARNATION) -> Neighbour:
    return Neighbour(incarnation, completed_tick, 1)


def test_a_frame_that_was_said_is_heard_once() -> None:
    ear = hearing()
    ear.put(encode(frame(7)))
    assert ear.has(7, there(7))
    assert ear.take(8, there(7)) == [frame(7)]
    assert ear.take(8, there(7)) == []
    assert ear.newest_tick == 7
    assert not ear.refused


def test_whoever_brings_a_frame_learns_in_which_tick_it_was_said() -> None:
    """Also of one that is said again, but of none that cannot be used."""
    ear = hearing()
    assert ear.put(encode(frame(7))) == 7
    assert ear.put(encode(frame(8))) == 8
    assert ear.put(encode(frame(7, run_id=RUN + 1))) == NO_TICK
    assert ear.put(b"") == NO_TICK
    assert ear.take(8, there(7)) == [frame(7)]
    assert ear.put(encode(frame(7))) == 7
    assert ear.put(encode(frame(6))) == NO_TICK


def test_what_arrives_early_waits_for_its_tick() -> None:
    """S4: a frame of tick k+1 that is here in tick k is heard in k+2 and not before."""
    ear = hearing()
    ear.put(encode(frame(8)))
    assert not ear.has(7, there(7))
    assert ear.take(8, there(7)) == []
    assert ear.take(9, there(8)) == [frame(8)]


def test_a_frame_of_a_tick_that_its_sender_did_not_complete_is_never_used() -> None:
    """S5: it died half way through tick 7; what it said then is void, also later."""
    ear = hearing()
    ear.put(encode(frame(6)))
    ear.put(encode(frame(7)))
    assert ear.take(7, there(6)) == [frame(6)]
    assert ear.take(8, there(6)) == []
    assert ear.newest_tick == 6
    ear.put(encode(frame(7)))
    assert ear.take(9, there(8)) == []
    assert ear.take(8, there(7)) == []


@pytest.mark.parametrize("incarnation", [INCARNATION - 1, INCARNATION + 1, 0])
def test_only_the_incarnation_that_the_roster_names_is_heard(incarnation: int) -> None:
    ear = hearing()
    ear.put(encode(frame(7, incarnation=incarnation)))
    assert not ear.has(7, there(7))
    assert ear.take(8, there(7)) == []
    assert ear.refused == {Reason.INCARNATION: 1}
    assert ear.newest_tick == NO_TICK


REFUSED = [
    (b"", Reason.SIZE),
    (bytes(257), Reason.SIZE),
    (encode(frame(7))[:-1] + b"\x00", Reason.CORRUPT),
    (seal(msgpack.packb([1, 2, RUN])), Reason.VERSION),
    (seal(b"\xc1"), Reason.MALFORMED),
    (encode(End(RUN, "no link frame")), Reason.MALFORMED),
    (encode(frame(7, run_id=RUN + 1)), Reason.RUN),
    (encode(frame(5)), Reason.TICK),
    (encode(frame(9)), Reason.TICK),
    (encode(frame(2**31 - 1)), Reason.TICK),
    (encode(frame(7, incarnation=INCARNATION - 1)), Reason.INCARNATION),
    (encode(frame(-1)), Reason.TICK),
    *(
        (encode(frame(7, **{field: value})), Reason.RANGE)
        for field in ("urgency", *LinkFrame._fields[-7:])
        for value in (nan, inf, -inf, 1.1e6, -1.1e6)
    ),
    (encode(frame(7, urgency=-0.1)), Reason.RANGE),
    (encode(frame(7, mass_kg=-0.1)), Reason.RANGE),
    (encode(frame(7, candidate=-1)), Reason.RANGE),
    (encode(frame(7, candidate=BOARDS)), Reason.RANGE),
]


@pytest.mark.parametrize(("payload", "reason"), REFUSED)
def test_what_cannot_be_used_is_counted_by_its_reason(payload: bytes, reason: Reason) -> None:
    ear = hearing()
    ear.take(7, there(6))
    ear.put(payload)
    assert ear.refused == {reason: 1}
    assert not ear.has(7, there(7))
    assert ear.take(8, there(7)) == []


def test_the_first_reason_in_the_order_of_checks_is_counted() -> None:
    """S1: run before tick before range."""
    ear = hearing()
    ear.take(7, there(6))
    ear.put(encode(frame(3, run_id=1, urgency=nan)))
    ear.put(encode(frame(3, urgency=nan)))
    ear.put(encode(frame(7, urgency=nan)))
    assert list(ear.refused.items()) == [(Reason.RUN, 1), (Reason.TICK, 1), (Reason.RANGE, 1)]


@pytest.mark.parametrize("value", [0.0, 1e6, -1e6])
def test_the_largest_numbers_allowed_are_heard(value: float) -> None:
    ear = hearing()
    ear.put(encode(frame(7, com_x_m=value, urgency=abs(value), candidate=BOARDS - 1)))
    assert ear.has(7, there(7))


@LAW
@given(st.binary(max_size=300))
def test_nothing_that_arrives_raises(payload: bytes) -> None:
    ear = hearing()
    ear.put(payload)
    assert sum(ear.refused.values()) == 1


@LAW
@given(
    st.lists(
        st.tuples(st.integers(0, 1), st.integers(0, 3), st.integers(0, 3)), min_size=4, max_size=4
    ),
    st.randoms(use_true_random=False),
)
def test_reordered_and_repeated_frames_are_heard_as_in_order(
    delays: list[tuple[int, ...]], chance: random.Random
) -> None:
    """Frames of four ticks, three times each, the first in time: heard in order, once.

    The others come up to a tick early or two late; that they do is not held against the sender.
    """
    ear = hearing()
    heard = []
    arrivals = [
        (tick + delay, tick)
        for tick, copies in zip(range(10, 14), delays, strict=True)
        for delay in copies
    ]
    chance.shuffle(arrivals)
    for now in range(10, 18):
        for due, tick in arrivals:
            if due == now:
                ear.put(encode(frame(tick)))
        heard += ear.take(now, there(now - 1))
    assert heard == [frame(tick) for tick in range(10, 14)]
    past = sum(due > tick + 2 for due, tick in arrivals)
    assert ear.refused[Reason.TICK] == past
    assert sum(ear.refused.values()) == past


@pytest.mark.parametrize("times", [1, 2, 100])
def test_what_has_been_heard_may_be_said_again(times: int) -> None:
    """When a link comes back its last frame is put once more; no counter tells the difference."""
    ear = hearing()
    for _ in range(times):
        ear.put(encode(frame(7)))
    assert ear.take(8, there(7)) == [frame(7)]
    for _ in range(times):
        ear.put(encode(frame(7)))
    assert ear.take(9, there(7)) == []
    assert not ear.refused


@pytest.mark.parametrize("order", [1, -1], ids=["rising", "falling"])
def test_a_board_that_is_not_let_in_yet_keeps_the_newest_of_what_it_hears(order: int) -> None:
    """The others go on meanwhile: its mailbox is bounded, and its first tick needs their newest."""
    ear = hearing()
    for tick in range(1, 10_001)[::order]:
        ear.put(encode(frame(tick)))
    held = [tick for tick in range(1, 10_001) if ear.has(tick, there(tick))]
    assert held == [9997, 9998, 9999, 10_000]
    assert ear.refused == {Reason.TICK: 10_000 - 4}
    assert ear.take(10_001, there(10_000)) == [frame(10_000)]


def test_a_backlog_is_dropped_when_its_ticks_have_passed() -> None:
    """A process that was stopped gets all that was said meanwhile, at once."""
    ear = hearing()
    ear.put(encode(frame(3)))
    ear.put(encode(frame(5)))
    assert ear.take(6, there(5)) == [frame(5)]
    for tick in range(6):
        ear.put(encode(frame(tick)))
    assert ear.refused == {Reason.TICK: 1 + 5}, "tick 3, then all but the one just heard"
    assert ear.take(7, there(6)) == []


def test_after_a_first_tick_no_frame_is_held_that_nobody_can_have_said_yet() -> None:
    """A storm of the future takes no room, and what is due comes through it."""
    ear = hearing()
    ear.take(7, there(6))
    for tick in range(10_000, 6, -1):
        ear.put(encode(frame(tick)))
        assert len(ear._waiting) <= 2
    assert ear.refused == {Reason.TICK: 10_000 - 8}
    assert ear.take(8, there(7)) == [frame(7)]
    assert ear.take(9, there(8)) == [frame(8)]


def test_an_older_incarnation_neither_overwrites_nor_crowds_out_the_new_one() -> None:
    """A process that was replaced goes on talking, also of ticks to come."""
    ear = hearing()
    ear.take(7, there(6))
    ear.put(encode(frame(7)))
    for old in range(INCARNATION):
        for tick in (7, 8):
            ear.put(encode(frame(tick, incarnation=old, com_x_m=9.0)))
    assert ear.refused == {Reason.INCARNATION: 2 * INCARNATION}
    assert ear.take(8, there(7)) == [frame(7)]


def test_a_newer_incarnation_that_is_not_on_the_roster_yet_does_not_hide_the_old() -> None:
    ear = hearing()
    ear.take(7, there(6))
    for new in range(INCARNATION + 100, INCARNATION, -1):
        ear.put(encode(frame(7, incarnation=new)))
    ear.put(encode(frame(7)))
    assert ear.take(8, there(7)) == [frame(7)]


LATE = PERFECT._replace(delay_ticks=3.0)


def test_a_delayed_frame_is_heard_that_much_later_and_marked_so() -> None:
    """S14, S18: bit j of the mask is the frame said in tick - 1 - j."""
    ear = hearing(LATE)
    for tick in range(7, 20):
        ear.put(encode(frame(tick - 1)))
        heard = ear.take(tick, there(tick - 1))
        assert heard == ([frame(tick - 4)] if tick >= 10 else [])
        assert ear.heard_mask == (1 << 3 if tick >= 10 else 0)


def test_delayed_frames_of_a_board_that_died_are_delivered_but_none_of_its_last_tick() -> None:
    """S5, S14: its last complete tick was 8; tick 9 was said and never completed."""
    ear = hearing(LATE)
    heard = []
    for tick in range(7, 20):
        if tick <= 10:
            ear.put(encode(frame(tick - 1)))
        neighbour = there(tick - 1) if tick <= 9 else there(8, 0)
        heard += ear.take(tick, neighbour)
    assert heard == [frame(tick) for tick in (6, 7, 8)]


def test_delayed_frames_are_void_once_the_incarnation_has_changed() -> None:
    ear = hearing(LATE)
    for tick in range(7, 10):
        ear.put(encode(frame(tick - 1)))
        ear.take(tick, there(tick - 1))
    heard = []
    for tick in range(10, 20):
        ear.put(encode(frame(tick - 1, incarnation=INCARNATION + 1)))
        heard += ear.take(tick, there(tick - 1, INCARNATION + 1))
    assert {one.incarnation for one in heard} == {INCARNATION + 1}
    assert [one.tick for one in heard] == list(range(9, 16))


def test_a_late_frame_is_overtaken_by_the_one_that_is_on_time() -> None:
    ear = hearing(LATE)
    for tick in range(7, 10):
        ear.put(encode(frame(tick - 1)))
        ear.take(tick, there(tick - 1))
    ear.link.change(PERFECT)
    for tick in range(10, 13):
        ear.put(encode(frame(tick - 1)))
        assert ear.take(tick, there(tick - 1)) == [frame(tick - 1), frame(tick - 4)]
        assert ear.heard_mask == 1 | 1 << 3
        assert ear.newest_tick == tick - 1


def test_a_duplicate_is_heard_in_each_of_its_ticks_and_changes_no_mask_beyond_its_bits() -> None:
    """Both copies in one tick are one bit; the newest tick heard never goes back."""
    ear = hearing(PERFECT._replace(duplicate=1.0))
    for tick in range(7, 12):
        ear.put(encode(frame(tick - 1)))
        heard = ear.take(tick, there(tick - 1))
        assert set(heard) == {frame(tick - 1)}
        assert ear.heard_mask == 1
    ear.link.change(PERFECT._replace(duplicate=1.0, jitter_ticks=5.0))
    newest = ear.newest_tick
    for tick in range(12, 200):
        ear.put(encode(frame(tick - 1)))
        heard = ear.take(tick, there(tick - 1))
        expected = 0
        for one in heard:
            expected |= 1 << (tick - 1 - one.tick)
        assert ear.heard_mask == expected < 1 << 6
        assert ear.newest_tick >= newest
        newest = ear.newest_tick


def test_the_largest_lateness_fits_the_mask_and_memory_stays_bounded() -> None:
    """31 ticks of delay, 31 of jitter and one of reordering: bit 63 is the last."""
    worst = PERFECT._replace(delay_ticks=31.0, jitter_ticks=31.0, reorder=1.0, duplicate=1.0)
    ear = hearing(worst)
    masks = 0
    for tick in range(7, 3000):
        ear.put(encode(frame(tick - 1)))
        ear.take(tick, there(tick - 1))
        masks |= ear.heard_mask
        assert len(ear._late) <= 64
        assert sum(map(len, ear._late.values())) <= 128
    assert masks == sum(1 << j for j in range(31, 64)) | 1 << 31
    assert masks.bit_length() == 64


def test_corrupted_frames_are_refused_as_corrupt_and_never_heard() -> None:
    """S1: whichever bit it is."""
    ear = hearing(PERFECT._replace(corrupt=1.0))
    for tick in range(7, 507):
        ear.put(encode(frame(tick - 1)))
        assert ear.take(tick, there(tick - 1)) == []
    assert ear.refused == {Reason.CORRUPT: 500}


def test_warm_up_knows_no_faults() -> None:
    """S8: the first frame that can be lost is said in tick 0."""
    ear = hearing(PERFECT._replace(cut=1.0))
    for tick in range(-9, 3):
        ear.put(encode(frame(tick - 1)))
        assert bool(ear.take(tick, there(tick - 1))) == (tick <= 0)


def test_unheard_ticks_is_the_age_of_the_neighbours_echo() -> None:
    ear = hearing()
    for tick, heard_tick, unheard in [
        (7, NO_TICK, 255),  # It has heard nothing yet.
        (8, 5, 1),
        (9, 7, 0),
        (10, 8, 0),
        (11, 8, 1),
        (12, 8, 2),
        (300, 8, 255),
        (301, 300, 0),
        (302, 2**63, 0),  # It lies; nothing is unheard for less than no time.
    ]:
        ear._used_tick = tick - 2
        ear.put(encode(frame(tick - 1, heard_tick=heard_tick)))
        assert ear.take(tick, there(tick - 1))
        assert ear.unheard_ticks == unheard, tick
