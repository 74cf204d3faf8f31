"""What a recording does not hold, because it follows from what it does: a run, told in full.

Rule 1: observations and link frames come out of a replay. A link frame is believed only when it has
        the CRC-32 that its sender's receipt in the recording names (S22).
Rule 2: what boards said that was recorded counts, and not what the replay makes of it. So a run of
        foreign boards, or of another machine's arithmetic, still has its frames' fates.
Rule 3: in realtime a link frame has no tick in which it ought to be heard, and so no fate: there
        are observations alone.
"""

from collections import Counter
from typing import NamedTuple

from deploy.recording.differences import REFUSED
from deploy.recording.fates import FateTracker, FrameOutcome
from deploy.recording.realtime_replay import IMPOSSIBLE, PlantReplay
from deploy.recording.replay import Link, Replay, UnplayableError
from plant_server.session.record import TickRecord
from plant_server.spool.spool import Spool
from protocol.robot.scenario import Scenario
from protocol.robot.states import COUNTERS
from protocol.wire.frames import (
    CRC_BYTES,
    Observation,
    ProtocolError,
    Reason,
    TorqueFrame,
    decode,
)
from protocol.wire.wiring import neighbours

Answers = tuple[TorqueFrame | None, ...]


class ReconstructedTick(NamedTuple):
    """One tick, told in full."""

    recorded: TickRecord
    answers: Answers
    """Torque frames as recorded; None where a board did not answer."""
    observations: dict[int, Observation]
    """What each board was told that answered."""
    links: dict[Link, bytes]
    """Link frames said, as far as their content is known."""
    settled: list[FrameOutcome]
    """Frames, of this tick or before, whose fate is known from now on."""


class Reconstruction:
    """Tells a recording in lockstep, tick by tick."""

    def __init__(self, scenario: Scenario) -> None:
        self.replay = Replay(scenario)
        self.links = list(self.replay.twin.lockstep.plant.roster.links)
        self._receipts = _receipts(len(scenario.joints))
        self._fates = FateTracker(len(scenario.joints))
        self._refused: dict[tuple[int, int, int], int] = {}
        """Of each board, incarnation and reason: the last count beyond the replay's own."""

    def tick(self, recorded: TickRecord) -> ReconstructedTick:
        """Tell the next tick. Raises `replay.UnplayableError` or `ProtocolError`."""
        answers = _answers(recorded, self._receipts)
        played = self.replay.play(recorded)
        self._count(recorded, played.record, answers)
        links = {
            link: said for link, said in played.links.items() if _believed(link, said, answers)
        }
        settled = list(self._fates.tick(played, answers))
        return ReconstructedTick(recorded, answers, played.observations, links, settled)

    def end(self) -> list[FrameOutcome]:
        """Tell what became of the frames that were under way when the recording ended."""
        return list(self._fates.end())

    def refused(self, link: Link) -> dict[str, int]:
        """How many frames the receiver of a link refused in the replay, by reason."""
        sender, receiver = link
        counts: Counter[str] = Counter()
        for firmware in self.replay.everybody:
            if firmware.config.index == receiver:
                hearing = firmware.hearings[firmware.config.neighbours.index(sender)]
                counts.update({str(reason): n for reason, n in hearing.refused.items()})
        return dict(counts)

    def refused_by_network(self, board: int) -> dict[str, int]:
        """How many frames a board refused beyond those that the replay's refused, by reason."""
        counts: Counter[str] = Counter()
        for (index, _, counter), beyond in self._refused.items():
            if index == board and beyond > 0:
                counts[COUNTERS[counter].removeprefix("refused_")] += beyond
        return dict(counts)

    def _count(self, told: TickRecord, own: TickRecord, answers: Answers) -> None:
        for board, answer in enumerate(answers):
            if answer is not None and answer.counter in REFUSED:
                beyond = 0
                if told.answers[board] != own.answers[board]:
                    ours = own.answers[board]
                    beyond = answer.counted - (decode(TorqueFrame, ours).counted if ours else 0)
                self._refused[board, answer.incarnation, answer.counter] = beyond


class RealtimeReconstruction:
    """The same of a recording in realtime."""

    links: tuple[Link, ...] = ()

    def __init__(self, spool: Spool) -> None:
        self._plant = PlantReplay(spool)
        self._receipts = _receipts(len(spool.scenario.boards))

    def tick(self, recorded: TickRecord) -> ReconstructedTick:
        """Tell the next tick. Raises `replay.UnplayableError` or `ProtocolError`."""
        answers = _answers(recorded, self._receipts)
        try:
            played = self._plant.play(recorded)
        except IMPOSSIBLE as error:
            raise UnplayableError(f"tick {recorded.tick} cannot have been: {error}") from error
        self._plant.forget()  # Boards are not played on it, and a long run has many frames.
        observations = {board: decode(Observation, said) for board, said in played.items()}
        return ReconstructedTick(recorded, answers, observations, {}, [])

    def end(self) -> list[FrameOutcome]:
        """No frame is under way."""
        return []

    def refused(self, _link: Link) -> dict[str, int]:
        """Not known, as below."""
        return {}

    def refused_by_network(self, _board: int) -> dict[str, int]:
        """Not known: a link model's frames are refused like the network's."""
        return {}


def _receipts(boards: int) -> list[int]:
    return [len(neighbours(board, boards)) for board in range(boards)]


def _answers(recorded: TickRecord, receipts: list[int]) -> Answers:
    return tuple(map(_read, recorded.answers, receipts))


def _read(answer: bytes, links: int) -> TorqueFrame | None:
    if not answer:
        return None
    frame = decode(TorqueFrame, answer)
    if len(frame.links) != links:
        raise ProtocolError(Reason.MALFORMED, f"receipts of {len(frame.links)} links")
    return frame


def _believed(link: Link, said: bytes, answers: Answers) -> bool:
    sender, receiver = link
    answer = answers[sender]
    if answer is None:
        return False
    place = neighbours(sender, len(answers)).index(receiver)
    return answer.links[place].sent_crc == int.from_bytes(said[-CRC_BYTES:], "little")
