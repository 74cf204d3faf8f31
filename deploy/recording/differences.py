"""Where a recording and its replay differ first, value by value and to the bit.

Rule: one thing is not compared, how many frames a board refused. That counts what a real network
brought, and a board does the same whatever that was.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from struct import pack
from typing import Any, NamedTuple

from deploy.recording.replay import Replay, UnplayableError
from plant_server.session.record import COMPLETE, FELL, Outcome, TickRecord
from plant_server.spool.spool import Spool
from protocol.robot.states import COUNTERS
from protocol.wire.frames import ProtocolError, TorqueFrame, decode

REFUSED = frozenset(i for i, name in enumerate(COUNTERS) if name.startswith("refused_"))
"""Counters of what the network brought, as `TorqueFrame.counter`."""
NOTHING = "nothing"
"""In place of a value that one side does not have."""


class Difference(NamedTuple):
    """The first value of a recording that its replay does not give."""

    tick: int
    what: str
    """Which value, in words."""
    recorded: Any
    replayed: Any

    @property
    def facts(self) -> dict[str, Any]:
        """The same for a program; values as text, for some are no numbers to JSON."""
        return {
            "tick": self.tick,
            "what": self.what,
            "recorded": repr(self.recorded),
            "replayed": repr(self.replayed),
        }

    def __str__(self) -> str:
        """Name it as a line for people."""
        return (
            f"tick {self.tick}: {self.what}: recorded {self.recorded!r}, replayed {self.replayed!r}"
        )


Pair = tuple[str, Any, Any]
"""What, as recorded, as replayed."""


def first_difference(spool: Spool, on_tick: Callable[[int], None]) -> Difference | None:
    """Play a recording again to its end; None if every value is the same."""
    scenario = spool.scenario
    replay = Replay(scenario)
    for recorded in spool.ticks:
        try:
            played = replay.play(recorded).record
        except UnplayableError as error:
            return Difference(recorded.tick, f"event ({error})", recorded.events, NOTHING)
        if not _same(recorded, played):
            found = _first(_tick_values(recorded, played, scenario.joints))
            if found is not None:
                return Difference(recorded.tick, *found)
        on_tick(recorded.tick)
    if spool.outcome is None:
        return None
    found = _first(_outcome_values(spool.outcome, replay))
    return found and Difference(spool.outcome.tick, *found)


def _same(recorded: TickRecord, played: TickRecord) -> bool:
    """Whether two ticks are equal, bytes and all; most are, and this is quick."""
    return (
        recorded.tick == played.tick
        and recorded.answers == played.answers
        and recorded.events == played.events
        and _bits(recorded) == _bits(played)
    )


def _bits(record: TickRecord) -> bytes:
    numbers = (*record.angles_rad, *record.rates_rad_s, *record.torques_nm)
    return pack(f"<{len(numbers)}d", *numbers)


def _first(pairs: Iterator[Pair]) -> Pair | None:
    return next((pair for pair in pairs if _differ(*pair[1:])), None)


def _differ(recorded: Any, played: Any) -> bool:
    """To the bit: -0.0 is not 0.0, and NaN is NaN. `repr` of a float gives it back exactly."""
    return repr(recorded) != repr(played)


def _tick_values(recorded: TickRecord, played: TickRecord, joints: Sequence[str]) -> Iterator[Pair]:
    """Every value of a tick, in the order in which one follows from another."""
    yield "tick", recorded.tick, played.tick
    for past, now in zip_longest(recorded.events, played.events, fillvalue=NOTHING):
        yield "event", past, now
    for name in ("angles_rad", "rates_rad_s"):
        yield from _by_joint(name, getattr(recorded, name), getattr(played, name), joints)
    answers = zip_longest(joints, recorded.answers, played.answers, fillvalue=b"")
    for joint, past_frame, frame in answers:
        yield from _frame_values(str(joint), bytes(past_frame), bytes(frame))
    yield from _by_joint("torques_nm", recorded.torques_nm, played.torques_nm, joints)


def _by_joint(
    name: str, recorded: Sequence[float], played: Sequence[float], joints: Sequence[str]
) -> Iterator[Pair]:
    for joint, past, now in zip_longest(joints, recorded, played, fillvalue=NOTHING):
        yield f"{name} of {joint}", past, now


def _frame_values(joint: str, recorded: bytes, played: bytes) -> Iterator[Pair]:
    yield f"torque frame of {joint}", _said(recorded), _said(played)
    if not recorded or recorded == played:
        return
    try:
        past = decode(TorqueFrame, recorded)
    except ProtocolError as error:
        yield f"torque frame of {joint} ({error})", recorded.hex(), played.hex()
        return
    now = decode(TorqueFrame, played)
    for name in TorqueFrame._fields[:-1]:
        if name != "counted" or past.counter not in REFUSED:
            yield f"{name} of the torque frame of {joint}", getattr(past, name), getattr(now, name)
    for i, (use, used) in enumerate(zip_longest(past.links, now.links)):
        yield f"links[{i}] of the torque frame of {joint}", use, used


def _said(frame: bytes) -> str:
    return "said" if frame else NOTHING


def _outcome_values(outcome: Outcome, replay: Replay) -> Iterator[Pair]:
    """How it ended: a run that came to its own end must have come to it here too."""
    by_itself = outcome.ending in (COMPLETE, FELL)
    ended = replay.twin.lockstep.plant.outcome(
        outcome.wall_s, None if by_itself else outcome.ending
    )
    for name, past, now in zip(Outcome._fields, outcome, ended, strict=True):
        yield f"{name} of the outcome", past, now
    if by_itself:
        yield "the run is over", True, replay.twin.lockstep.plant.over
