"""A checker of recordings: what must hold of any run, told from what it left behind alone.

It plays nothing again, so it judges runs of foreign boards too, and of other machines.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import copysign, fabs, isfinite

from plant_server.session.record import TickRecord
from plant_server.spool.spool import Spool
from protocol.robot.events import Admission, Departure, MidwayDeparture
from protocol.robot.scenario import ElectionSettings
from protocol.robot.states import DRIVING
from protocol.wire.frames import TorqueFrame, decode

Said = list[TorqueFrame | None]
"""What each board said in a tick; None: there was none, or it said nothing."""


class BrokenRecordingError(Exception):
    """A recording of what cannot be."""


def check(spool: Spool) -> int:
    """Judge a recording; in how many epochs S13 was claimed. Raises `BrokenRecordingError`."""
    for before, after in pairwise(spool.ticks):
        _law(after.tick == before.tick + 1, "ticks are gap-free", after.tick)
    said = list(_answers(spool.ticks))
    for board, entry in enumerate(spool.scenario.boards):
        motor, limit_nm = entry.actuator, entry.servo.torque_limit_nm
        if motor.ideal and entry.foot is None:
            _check_torques(board, spool.ticks, said, limit_nm, motor.hold_ticks)
    return _check_elections(spool.scenario.election, spool.ticks, said)


def _answers(ticks: Sequence[TickRecord]) -> Iterator[Said]:
    """Answers are of their tick, by who was on the roster, and of everybody who stayed."""
    roster = [0] * len(ticks[0].answers)
    for record in ticks:
        for event in record.events:
            match event:
                case Admission(board, incarnation):
                    roster[board] = incarnation
                case Departure(board, _) | MidwayDeparture(board, _):
                    roster[board] = 0
        said: Said = [decode(TorqueFrame, answer) if answer else None for answer in record.answers]
        for board, frame in enumerate(said):
            if frame is None:
                _law(roster[board] == 0, "who is there answers", (record.tick, board))
                continue
            _law(frame.tick == record.tick, "an answer is of its tick", frame)
            _law(frame.incarnation == roster[board], "an answer is of who is there", frame)
        yield said


def _check_torques(
    board: int, ticks: Sequence[TickRecord], said: list[Said], limit_nm: float, hold_ticks: int
) -> None:
    """What a motor without a will of its own does is what its board said, or nothing."""
    held_nm, refused = 0.0, 0
    for record, answers in zip(ticks, said, strict=True):
        frame = answers[board]
        if frame is None:
            held_nm, refused = 0.0, 0
        elif isfinite(frame.torque_nm):
            held_nm, refused = copysign(min(fabs(frame.torque_nm), limit_nm), frame.torque_nm), 0
        else:
            refused += 1
            held_nm = held_nm if refused <= hold_ticks else 0.0
        applied = record.torques_nm[board]
        allowed = (0.0, held_nm) if record.tick >= 0 else (0.0,)
        _law(applied in allowed, "a torque is what a living board said", (record.tick, board))
        driven = frame is not None and frame.state in DRIVING and record.tick >= 0
        _law(not driven or applied == held_nm, "who drives is obeyed", (record.tick, board))


def _check_elections(
    election: ElectionSettings, ticks: Sequence[TickRecord], said: list[Said]
) -> int:
    """S13, of epochs in which everybody was there, drove, and was heard at once by everybody."""
    period_ticks, rounds = election.period_ticks, election.rounds
    first = ticks[0].tick
    if not election.enabled or rounds < len(ticks[0].answers) - 1:
        return 0
    claimed = 0
    for begin in range(0, ticks[-1].tick - rounds + 1, period_ticks):
        window = said[begin - first : begin - first + rounds + 1]
        if begin < first or not _undisturbed(window):
            continue
        claimed += 1
        enabled = [board for board, frame in enumerate(window[-1]) if frame and frame.enabled]
        _law(len(enabled) == 1, "S13 exactly one is enabled", (begin, enabled))
    return claimed


def _undisturbed(window: list[Said]) -> bool:
    everybody = [[frame for frame in said if frame] for said in window]
    if {len(frames) for frames in everybody} != {len(window[0])}:
        return False
    members = {tuple(frame.incarnation for frame in frames) for frames in everybody}
    driving = all(frame.state in DRIVING for frames in everybody for frame in frames)
    heard = all(
        use.heard_mask & 1 for frames in everybody[1:] for frame in frames for use in frame.links
    )
    return len(members) == 1 and driving and heard


def _law(holds: object, name: str, detail: object) -> None:
    if not holds:
        raise BrokenRecordingError(f"{name}: {detail}")
