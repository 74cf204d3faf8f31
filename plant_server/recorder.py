"""The recorder of a plant process: ticks with their wall times, and what boards tell of theirs.

Rule 1: nothing of this enters control. It is called when a tick is over, and nobody waits for it.
Rule 2: each board tells of each tick once, in order, so what is kept is bounded by the run.
"""

from collections import Counter
from collections.abc import Iterable

from plant_server.enrolment import Enrolment
from plant_server.record import Outcome, TickRecord, Walls
from plant_server.spool import SpoolWriter
from protocol.frames import NO_TICK, ProtocolError, Reason, decode
from protocol.timing import Timing

Timings = Iterable[tuple[int, bytes]]
"""Boards, and the `Timing` frames that have come from them."""
NUMBER_END = 2**63
"""What is recorded can be read by whoever has 64 bits."""
NOT_HEARD = -1


class Recorder:
    """Decides what of a run goes into its spool."""

    def __init__(self, writer: SpoolWriter, enrolment: Enrolment) -> None:
        self.refused: Counter[Reason] = Counter()
        """Timings that were not of this run, of these boards, or of a tick to be told of."""
        self._writer = writer
        self._enrolment = enrolment
        self._told_ticks = [NO_TICK] * len(enrolment.joints)
        """The last tick of which each board has told."""

    def keep(self, record: TickRecord, walls: Walls, timings: Timings) -> None:
        """Keep a tick that is over, and what boards have told meanwhile."""
        self._writer.append(record, walls)
        self._keep_timings(timings, record.tick)

    def close(self, outcome: Outcome, timings: Timings) -> None:
        """Keep how the run ended, and what boards told on their way out."""
        self._keep_timings(timings, outcome.tick)
        self._writer.note({"timings_refused": self.refused})
        self._writer.close(outcome)

    def _keep_timings(self, timings: Timings, tick: int) -> None:
        """Keep frames that tell of ticks up to this one, and count what cannot be used."""
        for board, payload in timings:
            try:
                frame = decode(Timing, payload)
                self._check(board, frame, tick)
            except ProtocolError as error:
                self.refused[error.reason] += 1
            else:
                self._told_ticks[board] = frame.tick + len(frame.ticks) - 1
                self._writer.keep_timing(board, payload)

    def _check(self, board: int, frame: Timing, tick: int) -> None:
        if frame.run_id != self._enrolment.run_id:
            raise ProtocolError(Reason.RUN, f"run {frame.run_id:08x}")
        if frame.incarnation != self._enrolment.seats[board].incarnation:
            raise ProtocolError(Reason.INCARNATION, f"incarnation {frame.incarnation}")
        if not self._told_ticks[board] < frame.tick <= tick + 1 - len(frame.ticks):
            raise ProtocolError(Reason.TICK, f"{len(frame.ticks)} ticks from {frame.tick}")
        arrivals = [time_us for entry in frame.ticks for time_us in entry[3:]]
        others = [*frame[3:7], *(time_us for entry in frame.ticks for time_us in entry[:3])]
        if not arrivals or min(arrivals) < NOT_HEARD or min(others) < 0:
            raise ProtocolError(Reason.RANGE, f"{len(frame.ticks)} ticks, or a time below 0")
        if max(*arrivals, *others) >= NUMBER_END:
            raise ProtocolError(Reason.RANGE, f"a time of {max(*arrivals, *others)}")
