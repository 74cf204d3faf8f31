"""Every frame has one fate, and it is the one that its link and its two boards gave it."""

from collections import Counter
from functools import cache

import pytest

from deploy.recording.fates import FrameOutcome
from deploy.recording.frame_fate import NEVER, FrameFate
from deploy.recording.reconstruction import Reconstruction
from plant_server.spool.spool import Spool
from protocol.robot.states import COUNTERS
from protocol.wire.frames import CRC_BYTES, TorqueFrame, decode, encode
from protocol.wire.wiring import neighbours
from tests.deploy.spools import SHORT, bad_link, spool

Frames = dict[tuple[int, int, int], FrameOutcome]


def follow(of: Spool) -> Frames:
    """By sender, receiver and tick said; each settled once."""
    told = Reconstruction(of.scenario)
    found: Frames = {}

    def keep(settled: list[FrameOutcome]) -> None:
        for frame in settled:
            key = (*frame.link, frame.said_tick)
            assert key not in found, "settled twice"
            found[key] = frame

    for record in of.ticks:
        keep(told.tick(record).settled)
    keep(told.end())
    return found


@cache
def frames(name: str, *settings: str) -> Frames:
    return follow(spool(name, *settings))


def counts(found: Frames, link: tuple[int, int], first: int, end: int) -> Counter[FrameFate]:
    return Counter(found[*link, tick].fate for tick in range(first, end))


LINKS = [(0, 1), (1, 0), (1, 2), (2, 1)]


@pytest.mark.parametrize("name", SHORT)
def test_every_frame_has_one_fate(name: str) -> None:
    expected = {(*link, record.tick) for link in LINKS for record in spool(name).ticks}
    assert set(frames(name)) == expected


@pytest.mark.parametrize("name", SHORT)
def test_a_frame_was_heard_when_its_receiver_says_so(name: str) -> None:
    """Held against the receipts one by one: nothing heard is missed, nothing else is heard."""
    receipts: dict[tuple[int, int, int], int] = {}
    for record in spool(name).ticks:
        for receiver, answer in enumerate(record.answers):
            if not answer:
                continue
            uses = decode(TorqueFrame, answer).links
            for sender, use in zip(neighbours(receiver, 3), uses, strict=True):
                for ago in range(64):
                    if use.heard_mask >> ago & 1:
                        receipts.setdefault((sender, receiver, record.tick - 1 - ago), record.tick)
    heard = {key: one.heard_tick for key, one in frames(name).items() if one.heard_tick != NEVER}
    assert heard == receipts
    for (_, _, said_tick), frame in frames(name).items():
        assert (frame.fate is FrameFate.HEARD) == (frame.heard_tick == said_tick + 1)
        assert (frame.fate is FrameFate.LATE) == (frame.heard_tick > said_tick + 1)


@pytest.mark.parametrize(
    ("parameters", "fate", "late_ticks"),
    [
        ({}, FrameFate.HEARD, 0),
        ({"loss": 1.0}, FrameFate.LOST, None),
        ({"burst_start": 1.0, "burst_end": 0.0}, FrameFate.LOST, None),
        ({"cut": 1.0}, FrameFate.CUT, None),
        ({"cut": 1.0, "loss": 1.0}, FrameFate.CUT, None),
        ({"corrupt": 1.0}, FrameFate.CORRUPT, None),
        ({"delay_ticks": 4.0}, FrameFate.LATE, 4),
        ({"reorder": 1.0}, FrameFate.LATE, 1),
        ({"duplicate": 1.0}, FrameFate.HEARD, 0),
        ({"duplicate": 1.0, "delay_ticks": 31.0, "jitter_ticks": 0.0}, FrameFate.LATE, 31),
    ],
)
def test_the_fate_is_what_the_link_does(
    parameters: dict[str, float], fate: FrameFate, late_ticks: int | None
) -> None:
    found = follow(bad_link(**parameters))
    last = 299 - (late_ticks or 0)
    for link in [(1, 2), (2, 1)]:
        assert counts(found, link, 0, last) == Counter({fate: last})
        for tick in range(last):
            heard_tick = NEVER if late_ticks is None else tick + 1 + late_ticks
            assert found[*link, tick].heard_tick == heard_tick
    assert counts(found, (0, 1), -10, 299) == Counter({FrameFate.HEARD: 309}), (
        "the other is perfect"
    )


def test_what_was_under_way_when_the_recording_ends_is_pending() -> None:
    found = follow(bad_link(delay_ticks=4.0))
    assert counts(found, (1, 2), 295, 300) == Counter({FrameFate.PENDING: 5})
    assert counts(found, (0, 1), 299, 300) == Counter({FrameFate.PENDING: 1})


def test_warm_up_knows_no_faults() -> None:
    assert counts(follow(bad_link(cut=1.0)), (1, 2), -10, -1) == Counter({FrameFate.HEARD: 9})


def test_of_two_copies_the_first_counts() -> None:
    """One of each pair is up to 5 ticks late, the other as well: the earlier of the two."""
    of = bad_link(duplicate=1.0, jitter_ticks=5.0)
    kinds = counts(follow(of), (1, 2), 0, 290)
    assert set(kinds) == {FrameFate.HEARD, FrameFate.LATE}
    assert kinds[FrameFate.HEARD] > 290 / 6, "more often than one copy alone would be"


def test_a_pulled_board_says_nothing_and_hears_nothing() -> None:
    """Hotplug: the hip is away from tick 100 on, and back in tick 200."""
    found = frames("hotplug")
    up, down = (1, 2), (2, 1)
    assert found[*down, 99].fate is FrameFate.VOID, "said, but gone when it would have been heard"
    assert counts(found, down, 100, 200) == Counter({FrameFate.UNSAID: 100})
    assert counts(found, down, 200, 399) == Counter({FrameFate.HEARD: 199})
    assert counts(found, up, 98, 99) == Counter({FrameFate.HEARD: 1})
    assert counts(found, up, 99, 200) == Counter({FrameFate.NOBODY: 101}), "the new one did not ask"
    assert counts(found, up, 200, 399) == Counter({FrameFate.HEARD: 199})


@pytest.mark.parametrize("name", SHORT)
def test_s22_what_is_told_of_a_frame_has_the_crc_of_its_receipt(name: str) -> None:
    told = Reconstruction(spool(name).scenario)
    for record in spool(name).ticks:
        tick = told.tick(record)
        for (sender, receiver), said in tick.links.items():
            answer = tick.answers[sender]
            assert answer is not None
            use = answer.links[neighbours(sender, 3).index(receiver)]
            assert use.sent_crc == int.from_bytes(said[-CRC_BYTES:], "little")
        assert len(tick.links) == sum(
            len(neighbours(board, 3)) for board, answer in enumerate(tick.answers) if answer
        )


def test_s22_a_frame_that_is_not_what_its_sender_said_is_not_told() -> None:
    """A board that is not ours says other things; what became of them is known all the same."""
    of = spool()
    ticks = []
    for record in of.ticks:
        ankle, knee, hip = record.answers
        frame = decode(TorqueFrame, knee)
        links = tuple(use._replace(sent_crc=use.sent_crc ^ 1) for use in frame.links)
        ticks.append(record._replace(answers=(ankle, encode(frame._replace(links=links)), hip)))
    told = Reconstruction(of.scenario)
    for record in ticks:
        assert set(told.tick(record).links) == {(0, 1), (2, 1)}
    assert follow(of._replace(ticks=ticks)) == frames("paper")


def test_refusals_by_the_network_are_those_beyond_the_models() -> None:
    """The knee says that it has refused three stale frames more than it would have by itself."""
    of, counter = bad_link(corrupt=0.3), COUNTERS.index("refused_tick")
    ticks = []
    for record in of.ticks:
        ankle, knee, hip = record.answers
        frame = decode(TorqueFrame, knee)
        if record.tick >= 100 and frame.counter == counter:
            frame = frame._replace(counted=frame.counted + 3)
        ticks.append(record._replace(answers=(ankle, encode(frame), hip)))
    told = Reconstruction(of.scenario)
    for record in ticks:
        told.tick(record)
    assert [told.refused_by_network(board) for board in range(3)] == [{}, {"tick": 3}, {}]
    damaged = Counter(frame.fate for frame in follow(of).values())[FrameFate.CORRUPT]
    refused = [told.refused(link) for link in [(1, 2), (2, 1)]]
    assert [set(reasons) for reasons in refused] == [{"corrupt"}, {"corrupt"}]
    assert sum(reasons["corrupt"] for reasons in refused) == damaged > 100
