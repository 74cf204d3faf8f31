"""Arrays of a recording stand at the ticks that they are of."""

from functools import cache

import numpy as np

from deploy.recording.arrays import NOT_HEARD, Recording
from deploy.recording.frame_fate import FrameFate
from deploy.recording.trajectory import trajectory
from protocol.wire.timing import TickTiming, Timing
from protocol.wire.wiring import neighbours
from tests.deploy.recordings import read_back
from tests.deploy.spools import FACTS, bad_link, opened_ns, spool, timed


@cache
def storm() -> Recording:
    return read_back(timed(spool("storm")))


def test_the_trajectory_is_that_of_the_records() -> None:
    of = spool("storm")
    assert of.outcome is not None
    expected = trajectory(of.scenario, of.ticks, of.outcome)
    assert storm().trajectory.state_sha256 == expected.state_sha256
    assert storm().trajectory.ticks == 500


def test_wall_times_stand_at_their_ticks() -> None:
    """`timed` has told when: each thing some fixed time after the tick was opened."""
    found, of = storm(), spool("storm")
    opened = np.array([opened_ns(tick) for tick in range(500)])
    assert np.array_equal(found.opened_ns, opened)
    assert np.array_equal(found.closed_ns, opened + 600_000)
    answered = np.array([[bool(answer) for answer in r.answers] for r in of.ticks[10:]])
    assert np.array_equal(found.answered_ns > 0, answered)
    assert np.array_equal(found.taken_up_ns, opened[:, None] + [100_000] * 3)
    assert np.array_equal(found.decided_ns, opened[:, None] + [200_000] * 3)
    assert np.array_equal(found.said_ns, opened[:, None] + [300_000] * 3)


def test_a_frame_arrives_in_the_tick_after_it_was_said_and_stands_where_it_was_said() -> None:
    """The first neighbour's frame of the tick before was here 10 us after the tick began."""
    found = storm()
    for sender, receiver in [(1, 0), (0, 1), (1, 2)]:
        frames = found.links[sender, receiver]
        assert np.array_equal(frames.sent_ns, found.decided_ns[:, sender])
        assert np.array_equal(frames.arrived_ns[:-1], found.opened_ns[1:] + 10_000)
        assert frames.arrived_ns[-1] == 0
    assert not found.links[2, 1].arrived_ns.any(), "of the knee's second neighbour nothing is told"


def test_what_boards_did_not_get_to_tell_is_not_known() -> None:
    of = timed(spool())
    found = read_back(of._replace(reports=[t for t in of.timings if t[0] != 1 or t[1].tick < 50]))
    known = (found.said_ns[:, 1] > 0).tolist()
    last = known.index(False)
    assert 40 < last < 70
    assert not any(known[last:])
    assert found.said_ns[:, [0, 2]].all()


def test_times_of_ticks_that_the_run_did_not_have_do_no_harm() -> None:
    """A board of another's making may tell what it likes."""
    odd = [
        Timing(1, 1, tick, 2**62, 7, 0, 0, (TickTiming(0, 2**62, 5, -1, 2**62),) * 40)
        for tick in (-(2**31), -5, 280, 2**31 - 1)
    ]
    of = timed(spool())
    found = read_back(of._replace(reports=[(0, one) for one in odd]))
    assert np.flatnonzero(found.taken_up_ns[:, 0]).tolist() == [*range(35), *range(280, 300)]


def test_the_twin_has_no_times_but_fates() -> None:
    found = read_back(spool("storm"))
    for times in (found.opened_ns, found.answered_ns, found.closed_ns, found.said_ns):
        assert not times.any()
    assert not found.clocks_shared
    assert found.processes == {}
    for link, frames in found.links.items():
        assert np.array_equal(frames.fate, storm().links[link].fate)


def test_links_know_fates_sizes_and_refusals() -> None:
    found = read_back(bad_link(corrupt=0.5))
    frames = found.links[1, 2]
    assert set(frames.fate.tolist()) == {FrameFate.HEARD, FrameFate.CORRUPT, FrameFate.PENDING}
    heard = frames.fate == FrameFate.HEARD
    assert np.array_equal(frames.heard_tick, np.where(heard, np.arange(300) + 1, NOT_HEARD))
    assert frames.refused == {"corrupt": int((frames.fate == FrameFate.CORRUPT).sum())}
    assert frames.sent.all()
    assert 80 * 300 < frames.bytes_sent < 110 * 300
    assert set(found.links) == {(a, b) for a in range(3) for b in neighbours(a, 3)}


def test_a_joint_without_a_board_sends_nothing() -> None:
    frames = read_back(spool("hotplug")).links[2, 1]
    assert np.flatnonzero(~frames.sent).tolist() == list(range(100, 200))
    assert not frames.frame_bytes[100:200].any()
    assert frames.frame_bytes[200:].all()


def test_efforts_are_of_each_process() -> None:
    """Of a joint that had two boards: seconds of both, memory of the larger."""
    of = timed(spool())
    found = read_back(of)
    assert found.clocks_shared
    assert found.processes["plant"] == (FACTS["cpu_s"], 2.0)
    assert found.processes["hip"] == (0.314, 30_722 / 1024)
    second = of.timings[-1][1]._replace(incarnation=2, cpu_us=1_000_000, memory_kb=1024)
    again = read_back(of._replace(reports=[*of.timings, (2, second)]))
    assert again.processes["hip"] == (1.314, 30_722 / 1024)
    twin = read_back(spool()._replace(facts={"mode": "twin", "cpu_s": 2.0, "memory_kb": 1024}))
    assert twin.processes == {"twin": (2.0, 1.0)}


def test_clocks_are_shared_when_all_are_one_and_known() -> None:
    of = timed(spool())
    board, last = of.timings[-1]
    for clock in (0, 8):
        other = (board, last._replace(clock=clock))
        assert not read_back(of._replace(reports=[*of.timings[:-1], other])).clocks_shared
    assert not read_back(of._replace(facts={**FACTS, "clock": 0})).clocks_shared
