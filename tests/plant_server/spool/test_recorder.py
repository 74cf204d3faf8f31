"""What a plant records of its boards' wall times: of this run and its boards, each tick once."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from deploy.scenario_file.load import load
from plant_server.session.enrolment import Enrolment
from plant_server.session.record import COMPLETE, Outcome, TickRecord, TickWallTimes
from plant_server.spool.recorder import Recorder
from plant_server.spool.spool import Spool, SpoolWriter, read_spool
from protocol.robot.scenario import run_id
from protocol.wire.enrolment import EnrolmentRequest
from protocol.wire.frames import VERSION, Reason, encode, seal
from protocol.wire.timing import TickTiming, Timing

JOINTS = ["ankle", "knee"]
DIGEST = bytes(32)
RUN = run_id(DIGEST)
ENTRY = TickTiming(0, 100, 120, -1, 5)
FRAME = Timing(RUN, 1, 0, 10**15, 2**32 - 1, 10**7, 33_000, (ENTRY, ENTRY, ENTRY))
ANKLE, KNEE = range(2)


class Recording:
    """A recorder of two boards of incarnation 1, and what it has kept."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.desk = Enrolment(rig="robot", joints=JOINTS, digest=DIGEST)
        self.boot("ankle", 11)
        self.boot("knee", 12)
        self.recorder = Recorder(SpoolWriter(path, load("paper")), self.desk)

    def boot(self, joint: str, boot: int) -> None:
        about: tuple[Any, ...] = (
            VERSION,
            "robot",
            joint,
            0,
            DIGEST,
            boot,
            0,
            0,
            1.0,
            1.0,
            0.5,
            0.1,
        )
        assert self.desk.decide(EnrolmentRequest(*about)).reason == ""

    def keep(self, tick: int, *timings: tuple[int, Timing | bytes]) -> None:
        nothing = (0.0, 0.0)
        record = TickRecord(tick, nothing, nothing, nothing, (b"", b""), ())
        self.recorder.keep(record, TickWallTimes(1, (2, 3), 4))
        self.recorder.write(self._payloads(timings))

    def end(self, tick: int, *timings: tuple[int, Timing | bytes]) -> Spool:
        outcome = Outcome(tick, (0.0, 0.0), (0.0, 0.0), COMPLETE, 1.0)
        self.recorder.close(outcome, self._payloads(timings))
        return read_spool(self.path)

    @staticmethod
    def _payloads(
        timings: tuple[tuple[int, Timing | bytes], ...],
    ) -> list[tuple[int, type[Timing], bytes]]:
        return [
            (board, Timing, frame if isinstance(frame, bytes) else encode(frame))
            for board, frame in timings
        ]


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    return Recording(tmp_path / "run.spool")


def refused(recording: Recording) -> dict[Reason, int]:
    return dict(recording.recorder.refused)


def test_what_boards_tell_is_kept_with_whose_it_is(recording: Recording) -> None:
    later = FRAME._replace(tick=3)
    recording.keep(2, (KNEE, FRAME), (ANKLE, FRAME))
    recording.keep(3)
    recording.keep(7, (KNEE, later))
    on_its_way_out = FRAME._replace(tick=6)
    spool = recording.end(8, (KNEE, on_its_way_out))
    assert spool.timings == [
        (KNEE, FRAME),
        (ANKLE, FRAME),
        (KNEE, later),
        (KNEE, on_its_way_out),
    ]
    assert [record.tick for record in spool.ticks] == [2, 3, 7]
    assert spool.walls == [TickWallTimes(1, (2, 3), 4)] * 3
    assert spool.facts["reports_refused"] == {}
    assert spool.complete


def test_a_tick_that_was_not_written_yet_is_written_at_the_end(recording: Recording) -> None:
    nothing = (0.0, 0.0)
    for tick in (5, 6):
        record = TickRecord(tick, nothing, nothing, nothing, (b"", b""), ())
        recording.recorder.keep(record, TickWallTimes(tick, (2, 3), 4))
    spool = recording.end(7, (KNEE, FRAME._replace(tick=4)))
    assert [record.tick for record in spool.ticks] == [5, 6]
    assert [walls and walls.opened_ns for walls in spool.walls] == [5, 6]
    assert spool.timings == [(KNEE, FRAME._replace(tick=4))]


def test_a_tick_is_told_once(recording: Recording) -> None:
    """Neither again nor overlapping: what is kept is bounded by the run, whoever sends what."""
    recording.keep(9, (KNEE, FRAME), (KNEE, FRAME), (KNEE, FRAME._replace(tick=2)))
    recording.keep(10, (KNEE, FRAME._replace(tick=-5)), (ANKLE, FRAME))
    spool = recording.end(11)
    assert spool.timings == [(KNEE, FRAME), (ANKLE, FRAME)]
    assert spool.facts["reports_refused"] == {"tick": 3}


def test_nobody_tells_of_what_has_not_been(recording: Recording) -> None:
    """The tick that is open is the last that a board may have played."""
    recording.keep(0, (KNEE, FRAME))
    assert refused(recording) == {Reason.TICK: 1}
    recording.keep(1, (KNEE, FRAME))
    assert refused(recording) == {Reason.TICK: 1}


def test_a_successor_tells_of_its_own_ticks_and_its_predecessor_no_more(
    recording: Recording,
) -> None:
    recording.keep(2, (KNEE, FRAME))
    recording.desk.gone(KNEE, 12)
    recording.boot("knee", 13)
    new = FRAME._replace(incarnation=2, tick=5)
    recording.keep(9, (KNEE, FRAME._replace(tick=3)), (KNEE, new))
    assert recording.end(10).timings == [(KNEE, FRAME), (KNEE, new)]
    assert refused(recording) == {Reason.INCARNATION: 1}


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (b"", Reason.SIZE),
        (encode(FRAME)[:-1], Reason.CORRUPT),
        (seal(b"\x91\x01"), Reason.VERSION),
        (seal(b"\x92\x02\x06"), Reason.MALFORMED),
        (FRAME._replace(run_id=RUN + 1), Reason.RUN),
        (FRAME._replace(incarnation=0), Reason.INCARNATION),
        (FRAME._replace(ticks=()), Reason.RANGE),
        (FRAME._replace(base_ns=-1), Reason.RANGE),
        (FRAME._replace(base_ns=2**63), Reason.RANGE),
        (FRAME._replace(clock=2**64 - 1), Reason.RANGE),
        (FRAME._replace(cpu_us=-5), Reason.RANGE),
        (FRAME._replace(memory_kb=-5), Reason.RANGE),
        (FRAME._replace(ticks=(ENTRY._replace(taken_up_us=-1),)), Reason.RANGE),
        (FRAME._replace(ticks=(ENTRY, ENTRY._replace(said_us=2**63))), Reason.RANGE),
        (FRAME._replace(ticks=(ENTRY._replace(second_arrived_us=-2),)), Reason.RANGE),
    ],
    ids=str,
)
def test_what_cannot_be_used_is_counted_and_nothing_else(
    recording: Recording, frame: Timing | bytes, reason: Reason
) -> None:
    recording.keep(9, (KNEE, frame), (ANKLE, FRAME))
    spool = recording.end(10)
    assert spool.timings == [(ANKLE, FRAME)]
    assert recording.recorder.refused == Counter({reason: 1})
