"""What was recorded, as a spool: of a run's `run.mcap`, or of what is there before one is made.

Rule: what is read from outside is checked here, so that nobody after has to. A file that is none of
ours, not whole or of another version is the user's affair: one line, and an exit code.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from deploy.recording.files import UnreadableError, is_mcap, recording_file
from deploy.recording.mcap.file import read_mcap
from deploy.recording.replay import Replay
from plant_server.session.record import Outcome
from plant_server.spool.spool import PLANT, Spool, read_spool
from protocol.robot.events import check_event
from protocol.wire.frames import LinkFrame, ProtocolError, decode
from protocol.wire.trace import LastWord, Trace
from protocol.wire.trace_differences import decode_told
from protocol.wire.wiring import neighbours


def read_spool_of(path: Path, *, whole: bool = True) -> Spool:
    """Read what was recorded; without `whole`, of a damaged file what comes before the damage.

    Raises `UnreadableError`.
    """
    file = recording_file(path)
    try:
        spool = read_mcap(file, whole=whole) if is_mcap(file) else read_spool(file)
        _check(spool)
    except OSError as error:
        raise UnreadableError(f"cannot read {file}: {error.strerror}") from error
    except (AttributeError, LookupError, ProtocolError, TypeError, ValueError) as error:
        raise UnreadableError(f"{file} is no recording that can be used: {error}") from error
    return spool


def _check(spool: Spool) -> None:
    """Whether everything is there and of the right shape; raises ValueError and the like."""
    joints = _check_scenario(spool)
    if not spool.ticks:
        raise ValueError("it ends before its first tick")
    for tick, record in enumerate(spool.ticks, spool.ticks[0].tick):
        if record.tick != tick:
            raise ValueError(f"after tick {tick - 1} comes tick {record.tick}")
        _check_sizes(f"tick {tick}", record[1:5], joints)
        for event in record.events:
            check_event(event, spool.scenario.joints)
    _check_realtime(spool, joints)
    for walls in filter(None, spool.walls):
        _check_sizes("a wall time", [walls.answered_ns], joints)
    if spool.outcome is not None:
        _check_outcome(spool.outcome, spool.ticks[-1].tick + 1, joints)


def _check_scenario(spool: Spool) -> int:
    """Whether it can be run; how many joints it has. And whether facts can be read."""
    if type(spool.facts) is not dict:
        raise ValueError("its facts are no table")
    if "cpu_s" in spool.facts:
        for name in ("cpu_s", "memory_kb"):
            float(spool.facts[name])
    Replay(spool.scenario)
    return len(spool.scenario.boards)


def _check_realtime(spool: Spool, joints: int) -> None:
    """Whether what boards tell of their turns is of these boards, and can be read."""
    for board, told in spool.realtime:
        if board == PLANT:
            for name in ("behind_ms_max", "slipped_s"):
                float(told[name])
        elif not 0 <= board < joints:
            raise ValueError(f"board {board} of {joints} tells of its turns")
        else:
            _check_turns(decode_told(told), len(neighbours(board, joints)))


def _check_turns(told: Trace | LastWord, links: int) -> None:
    if isinstance(told, Trace):
        if any(len(lived.taken) != links for lived in told.lived):
            raise ValueError(f"turns of a board with {links} neighbours have others")
    else:
        decode(LinkFrame, told.frame)


def _check_outcome(outcome: Outcome, ticks: int, joints: int) -> None:
    _check_sizes("the outcome", outcome[1:3], joints)
    if outcome.tick != ticks or type(outcome.ending) is not str:
        raise ValueError(f"it ends with {outcome.ending!r} after {outcome.tick} of {ticks} ticks")


def _check_sizes(whose: str, parts: Sequence[Sequence[Any]], joints: int) -> None:
    if {len(part) for part in parts} != {joints}:
        raise ValueError(f"{whose} is not of {joints} joints")
