"""The recorder of a plant process: ticks with their wall times, and what boards tell of theirs.

Rule 1: nothing of this enters control, and nobody waits for it: a tick that is over is written
        while the boards think about the next one.
Rule 2: each board tells of each tick once, in order, so what is kept is bounded by the run.
"""

from collections import Counter
from collections.abc import Iterable

from plant_server.session.enrolment import Enrolment
from plant_server.session.record import Outcome, TickRecord, TickWallTimes
from plant_server.spool.spool import SpoolWriter
from protocol.process.stopping import undisturbed
from protocol.wire.frames import NO_TICK, ProtocolError, Reason, Report, receive

Reports = Iterable[tuple[int, type[Report], bytes]]
"""Boards, and frames of a kind of report that have come from them."""


class Recorder:
    """Decides what of a run goes into its spool."""

    def __init__(self, writer: SpoolWriter, enrolment: Enrolment) -> None:
        self.refused: Counter[Reason] = Counter()
        """Reports that were not of this run, of these boards, or of a tick to be told of."""
        self._writer = writer
        self._enrolment = enrolment
        self._unwritten: list[tuple[TickRecord, TickWallTimes]] = []
        self._open_tick = NO_TICK
        self._told_ticks: dict[tuple[type[Report], int], int] = {}
        """The last tick of which each board has told, in each kind of report."""

    def keep(self, record: TickRecord, walls: TickWallTimes) -> None:
        """Take a tick that is over, to write it when there is time."""
        self._unwritten.append((record, walls))

    def write(self, reports: Reports) -> None:
        """Write what has been taken, and what boards have told meanwhile."""
        with undisturbed:  # A tick is written once.
            for record, walls in self._unwritten:
                self._writer.append(record, walls)
                self._open_tick = record.tick + 1
            self._unwritten.clear()
            self._keep_reports(reports)

    def keep_realtime(self, board: int, told: bytes | dict[str, float]) -> None:
        """Keep what a board in realtime has told of its turns; of `PLANT`, its account."""
        self._writer.keep_realtime(board, told)

    def close(self, outcome: Outcome, reports: Reports) -> None:
        """Write the rest: what boards told on their way out, and how the run ended."""
        self.write(reports)
        self._writer.note({"reports_refused": self.refused})
        self._writer.close(outcome)

    def _keep_reports(self, reports: Reports) -> None:
        """Keep frames that tell of ticks up to the open one, and count what cannot be used."""
        for board, kind, payload in reports:
            try:
                frame, out_of_range = receive(kind, payload)
                self._check(board, frame)
                if out_of_range is not None:
                    raise out_of_range
            except ProtocolError as error:
                self.refused[error.reason] += 1
            else:
                self._told_ticks[kind, board] = frame.tick + _ticks(frame) - 1
                self._writer.keep_report(board, payload)

    def _check(self, board: int, frame: Report) -> None:
        if frame.run_id != self._enrolment.run_id:
            raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
        if frame.incarnation != self._enrolment.seats[board].incarnation:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
        ticks, told_tick = _ticks(frame), self._told_ticks.get((type(frame), board), NO_TICK)
        if not told_tick < frame.tick <= self._open_tick + 1 - ticks:
            raise ProtocolError(Reason.TICK, f"{ticks} ticks from {frame.tick}")
        if not ticks:
            raise ProtocolError(Reason.RANGE, "no ticks")


def _ticks(report: Report) -> int:
    """Of how many ticks on end a report is."""
    return len(getattr(report, "ticks", (None,)))
