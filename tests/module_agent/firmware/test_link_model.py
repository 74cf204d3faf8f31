"""Faults of a link: drawn once, from (seed, link, tick), at the rates that were asked for (S14)."""

from collections.abc import Iterator
from itertools import groupby, pairwise
from math import sqrt
from statistics import fmean

import pytest

from module_agent.firmware.hearing import Hearing
from module_agent.firmware.link_model import LOST, ON_TIME, Fate, LinkModel
from protocol.robot.chance import draw
from protocol.robot.events import PERFECT, LinkParameters
from protocol.wire.frames import LinkFrame, Neighbour, encode

pytestmark = pytest.mark.sampling

Z_99_9 = 3.29  # Half width of a 99.9 % interval, in standard deviations.
FRAMES = 20_000
EVERYTHING = LinkParameters(
    loss=0.1,
    burst_start=0.05,
    burst_end=0.3,
    burst_loss=0.8,
    delay_ticks=2.0,
    jitter_ticks=4.0,
    duplicate=0.2,
    reorder=0.2,
    corrupt=0.05,
)


def model(seed: int = 7, sender: int = 0, receiver: int = 1, **standing: float) -> LinkModel:
    return LinkModel(
        seed=seed, sender=sender, receiver=receiver, standing=PERFECT._replace(**standing)
    )


def fates(link: LinkModel, frames: int = FRAMES) -> Iterator[Fate]:
    return map(link.fate, range(frames))


def assert_share(hits: int, trials: int, expected: float) -> None:
    """A share is within the 99.9 % interval of a probability."""
    margin = Z_99_9 * sqrt(expected * (1.0 - expected) / trials) + 0.5 / trials
    assert abs(hits / trials - expected) <= margin


def test_the_fate_of_a_frame_depends_on_nothing_that_is_asked_besides() -> None:
    """Same seed, link, tick and parameters: the same fate, whoever else draws."""
    alone = list(fates(_bad(), 500))
    crowd = [_bad(), _bad(sender=2), _bad(seed=8), _bad(sender=1, receiver=0)]
    together = [[link.fate(tick) for link in crowd] for tick in range(500)]
    assert [row[0] for row in together] == alone
    for other in (1, 2, 3):
        assert [row[other] for row in together] != alone


def _bad(**link: int) -> LinkModel:
    found = model(**link)
    found.change(EVERYTHING)
    return found


def test_one_kind_of_fault_does_not_disturb_another() -> None:
    """Which frames are lost is the same whether or not others are late, doubled or damaged."""
    lost = [fate == LOST for fate in fates(model(loss=0.3), 2000)]
    busy = model(loss=0.3, jitter_ticks=5.0, duplicate=0.5, reorder=0.5, corrupt=0.5)
    assert [fate == LOST for fate in fates(busy, 2000)] == lost


def test_a_perfect_link_delivers_everything_on_time() -> None:
    assert set(fates(model(), 100)) == {ON_TIME}


@pytest.mark.parametrize("loss", [0.01, 0.1, 0.2, 0.5, 0.9])
def test_frames_are_lost_as_often_as_asked(loss: float) -> None:
    assert_share(sum(fate == LOST for fate in fates(model(loss=loss))), FRAMES, loss)


@pytest.mark.parametrize("name", ["loss", "cut"])
def test_certain_loss_is_certain(name: str) -> None:
    link = model()
    link.change(PERFECT._replace(**{name: 1.0}))
    assert set(fates(link, 1000)) == {LOST}


@pytest.mark.parametrize(("start", "end"), [(0.02, 0.2), (0.1, 0.5), (0.05, 0.05)])
def test_bursts_are_as_long_and_as_frequent_as_gilbert_and_elliott_say(
    start: float, end: float
) -> None:
    """Lost in the bad state only: mean run of losses 1 / end, their share start / (start + end).

    The interval of the share is widened by the chain's correlation, (2 - s - e) / (s + e).
    """
    lost = [fate == LOST for fate in fates(model(burst_start=start, burst_end=end), 60_000)]
    runs = [len(list(run)) for bad, run in groupby(lost) if bad]
    deviation = sqrt(1.0 - end) / end
    assert abs(fmean(runs) - 1.0 / end) <= Z_99_9 * deviation / sqrt(len(runs))
    share = start / (start + end)
    spread = sqrt(share * (1.0 - share) * (2.0 - start - end) / (start + end) / len(lost))
    assert abs(fmean(lost) - share) <= Z_99_9 * spread


def test_in_a_burst_frames_are_lost_on_top_of_the_ordinary_loss() -> None:
    always_bad = model(burst_start=1.0, burst_end=0.0, burst_loss=0.5, loss=0.2)
    lost = sum(fate == LOST for fate in fates(always_bad))
    assert_share(lost, FRAMES, 1.0 - (1.0 - 0.5) * (1.0 - 0.2))


def test_a_link_is_good_at_first_and_after_each_change_and_admission() -> None:
    """S14: from good it turns bad before the first frame with probability `burst_start` only."""
    bursty = PERFECT._replace(burst_start=0.1, burst_end=0.0)
    change = [model(seed=seed) for seed in range(2000)]
    for begin in (lambda link: link.change(bursty), LinkModel.restart):
        for link in change:
            begin(link)
        first = sum(link.fate(5) == LOST for link in change)
        assert_share(first, len(change), 0.1)
        for link in change:
            for tick in range(6, 60):
                link.fate(tick)
        assert sum(link._bad for link in change) > 1900, "by then most are bad for good"


@pytest.mark.parametrize(("delay", "jitter"), [(0, 0), (3, 0), (0, 4), (2, 5), (31, 31)])
def test_lateness_is_the_delay_and_up_to_the_jitter_all_equally_likely(
    delay: int, jitter: int
) -> None:
    link = model(delay_ticks=float(delay), jitter_ticks=float(jitter))
    late = [fate.late_ticks[0] for fate in fates(link)]
    assert set(late) == set(range(delay, delay + jitter + 1))
    for value in range(delay, delay + jitter + 1):
        assert_share(late.count(value), FRAMES, 1.0 / (jitter + 1))


def test_a_frame_that_is_held_back_is_overtaken_by_the_next() -> None:
    link = model(reorder=0.3)
    late = [fate.late_ticks for fate in fates(link)]
    assert set(late) == {(0,), (1,)}
    assert_share(late.count((1,)), FRAMES, 0.3)


def test_a_duplicate_has_a_lateness_of_its_own() -> None:
    link = model(duplicate=0.25, delay_ticks=1.0, jitter_ticks=3.0)
    copies = [fate.late_ticks for fate in fates(link)]
    twice = [pair for pair in copies if len(pair) == 2]
    assert_share(len(twice), FRAMES, 0.25)
    assert {late for pair in twice for late in pair} == {1, 2, 3, 4}
    assert_share(sum(one == other for one, other in twice), len(twice), 0.25)


def test_a_damaged_frame_has_one_flipped_bit_and_any() -> None:
    bits = [fate.flipped_bit for fate in fates(model(corrupt=0.5))]
    damaged = [bit for bit in bits if bit is not None]
    assert_share(len(damaged), FRAMES, 0.5)
    assert all(fate.late_ticks == () for fate in fates(model(corrupt=1.0), 100))
    size = 130
    places = {(bit // 8 % size, bit % 8) for bit in damaged}
    assert len(places) == size * 8, "every bit of a frame is flipped now and then"


DIRECTED = [(sender, receiver) for sender in range(4) for receiver in (sender - 1, sender + 1)]


def test_no_two_directed_links_of_any_two_seeds_share_their_draws() -> None:
    """Neither the directions of a link, nor links of robots whose seeds differ in a bit."""
    streams = [
        tuple(draw(seed, *link, tick, 1) for tick in range(3))
        for seed in range(16)
        for link in DIRECTED
    ]
    assert len(set(streams)) == len(streams)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"sender": 0, "receiver": 1}, {"sender": 1, "receiver": 0}),
        ({"sender": 0, "receiver": 1}, {"sender": 2, "receiver": 1}),
        ({"seed": 0}, {"seed": 1}),
        ({"seed": 0, "sender": 0}, {"seed": 2, "sender": 2}),
    ],
)
def test_losses_of_two_links_are_independent(one: dict[str, int], other: dict[str, int]) -> None:
    """Both lost: as often as chance has it."""
    links = []
    for which in (one, other):
        link = model(**which)
        link.change(PERFECT._replace(loss=0.3))
        links.append([fate == LOST for fate in fates(link)])
    both = sum(a and b for a, b in zip(*links, strict=True))
    assert_share(both, FRAMES, 0.09)


def test_losses_of_following_ticks_are_independent() -> None:
    lost = [fate == LOST for fate in fates(model(loss=0.4))]
    pairs = list(pairwise(lost))
    assert_share(sum(a and b for a, b in pairs), len(pairs), 0.16)


@pytest.mark.parametrize("parameters", [EVERYTHING, PERFECT._replace(reorder=0.5, duplicate=0.5)])
def test_what_comes_through_is_what_was_said(parameters: LinkParameters) -> None:
    """No fault invents or alters a frame; the ear hears some of what was said, maybe twice."""
    ear = Hearing(
        LinkModel(seed=5, sender=1, receiver=0, standing=parameters), run_id=2**31, boards=3
    )
    said, heard = [], []
    for tick in range(1, 400):
        frame = LinkFrame(2**31, 1, tick - 1, -1, 0, 1, 0.5, 2, -1, 0.1 * tick, *(0.0,) * 6)
        said.append(frame)
        ear.put(encode(frame))
        heard += ear.take(tick, Neighbour(1, tick - 1, 1))
    assert set(heard) <= set(said)
    assert all(heard.count(frame) <= 2 for frame in said)
    overtaken = [a for a, b in pairwise(heard) if b.tick < a.tick]
    assert overtaken, "and not in order"
