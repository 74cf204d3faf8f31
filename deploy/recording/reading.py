"""A recording as arrays, from the messages of its `run.mcap`: believed, and nothing computed again.

Rule 1: no board and no plant is played here, and no code of anybody else's is run.
Rule 2: what does not fit together (another number of joints, a tick left out, a board that there is
        none of) makes a file that cannot be used: one line, so that nobody after has to check.
Rule 3: a channel that somebody has left out of the file is as if nothing had been said on it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from deploy.recording.arrays import NOT_HEARD, LinkHistory, Recording, a_tick_later
from deploy.recording.epochs import Epochs
from deploy.recording.files import MCAP, UnreadableError, is_mcap, is_spool, recording_file
from deploy.recording.frame_fate import NEVER, FrameFate
from deploy.recording.mcap import rows, topics
from deploy.recording.mcap.bodies import to_event
from deploy.recording.mcap.contents import DAMAGE
from deploy.recording.mcap.rows import Channels, read_channels
from deploy.recording.realtime_times import Lives, RealtimeRecord, RealtimeTimes, times_of
from deploy.recording.trajectory import CUT_OFF, NOBODY, Floats, Integers, Trajectory, cut_off_s
from deploy.recording.wall_times import (
    BoardTimes,
    PlantTimes,
    board_times,
    clocks_shared,
    efforts,
)
from plant_server.spool.spool import recorded_scenario
from protocol.robot.cadence import cadence_of
from protocol.robot.events import Event, check_event
from protocol.robot.scenario import Scenario
from protocol.wire.frames import NO_TICK
from protocol.wire.timing import TickTiming, Timing
from protocol.wire.trace import TakenFrames, TickTrace
from protocol.wire.wiring import neighbours

Happened = tuple[int, Event]
FATES = {fate.name.lower(): fate for fate in FrameFate}
_SAID = ("torque_nm", "controlled_rad", "urgency"), (
    "state", "enabled", "epoch", "round", "candidate"
)  # fmt: skip
"""Fields of a torque frame that arrays are made of: numbers, and integers."""


class RecordedBody(NamedTuple):
    """What the plant recorded of R ticks, warm-up included, and how it ended."""

    first_tick: int
    """At most 0."""
    angles_rad: Floats
    """(R, N), as those below."""
    rates_rad_s: Floats
    torques_nm: Floats
    ended: rows.OutcomeRow

    @property
    def ticks(self) -> int:
        """T: how many ticks the body was free, and is known to have been."""
        return max(0, self.ended.tick)

    def free(self, values: Any) -> Any:
        """Of values by tick, (R, ...), those of the free ticks, (T, ...)."""
        return values[-self.first_tick : self.ticks - self.first_tick]


def read_recording(path: Path) -> Recording:
    """Read a run from its folder or its `run.mcap`.

    Raises `deploy.recording.files.UnreadableError` with one line for the user.
    """
    file = recording_file(path)
    try:
        if is_spool(file):
            raise UnreadableError(f"{file} is a spool; decmesh recover {path} makes {MCAP} of it")
        if not is_mcap(file):
            raise ValueError("it is no MCAP file")
        return recording(read_channels(file))
    except OSError as error:
        raise UnreadableError(f"cannot read {file}: {error.strerror}") from error
    except DAMAGE as error:
        raise UnreadableError(f"{file} is no recording that can be used: {error}") from error


def recording(said: Channels) -> Recording:
    """Make arrays of what the messages of a file say. Raises one of `DAMAGE`."""
    scenario, facts = _scenario(said), _facts(said)
    joints = scenario.joints
    timings = list(_timings(said, joints))
    plant_timings = said.rows(topics.TIMING, rows.PlantTimingRow)
    body = _body(said, len(joints), plant_timings)
    events = _events(said, body, joints)
    answers = _answers(said, joints, body)
    run = _trajectory(scenario, body, events, answers)
    boards = board_times(timings, run.ticks, len(joints))
    plant = _plant_times(plant_timings, run.ticks, len(joints))
    refused = said.only(topics.REFUSED, rows.RefusedRow) or rows.RefusedRow([], [])
    return Recording(
        trajectory=run,
        facts=facts,
        complete=said.metadata["complete"] == "true",
        logical_sha256=said.metadata["logical_sha256"],
        opened_ns=plant.opened_ns,
        answered_ns=plant.answered_ns,
        closed_ns=plant.closed_ns,
        taken_up_ns=boards.taken_up_ns,
        decided_ns=boards.decided_ns,
        said_ns=boards.said_ns,
        epochs=_epochs(said, run),
        links={} if cadence_of(scenario) else _links(said, run, boards, refused.by_link),
        refused_by_network=[
            {one.reason: one.frames for one in refused.by_network if one.joint == joint}
            for joint in joints
        ],
        processes=efforts(joints, facts, timings),
        clocks_shared=clocks_shared(facts, timings),
        realtime=_realtime(said, scenario, answers["said_tick"][-body.first_tick :], events),
    )


def _scenario(said: Channels) -> Scenario:
    """What was run."""
    row = said.only(topics.SCENARIO, rows.ScenarioRow)
    if row is None:
        raise ValueError("it does not say what was run")
    return recorded_scenario(row.resolved.encode())


def _facts(said: Channels) -> dict[str, Any]:
    """Facts of the run, if those that are used are what they should be."""
    row = said.only(topics.FACTS, rows.FactsRow)
    found = {} if row is None else rows.json_table(row.all)
    for name, kind in (("versions", dict[str, str | None]), ("mode", str), ("clock", int)):
        if name in found:
            msgspec.convert(found[name], kind)
    if "cpu_s" in found:
        msgspec.convert((found["cpu_s"], found["memory_kb"]), tuple[float, float])
    return found


def _body(said: Channels, joints: int, timings: Sequence[rows.PlantTimingRow]) -> RecordedBody:
    found = said.rows(topics.PLANT_TICK, rows.TickRow)
    if not found:
        raise ValueError("it ends before its first tick")
    first, last = found[0], found[-1]
    for tick, row in enumerate(found, min(first.tick, 0)):
        if row.tick != tick:
            raise ValueError(f"tick {row.tick} is in the place of tick {tick}")
        sizes = {len(row.angles_rad), len(row.rates_rad_s), len(row.torques_nm)}
        if sizes != {joints}:
            raise ValueError(f"tick {tick} is not of {joints} joints")
    ended = said.only(topics.OUTCOME, rows.OutcomeRow)
    if ended is None:  # What the last tick before a cut led to is not known: it has no part.
        wall_s = cut_off_s(last.tick, [timing.opened_ns for timing in timings])
        ended = rows.OutcomeRow(last.tick, last.angles_rad, last.rates_rad_s, CUT_OFF, wall_s)
    elif ended.tick != last.tick + 1:
        raise ValueError(f"it ends after tick {ended.tick - 1}, and with tick {last.tick}")
    if {len(ended.angles_rad), len(ended.rates_rad_s)} != {joints}:
        raise ValueError(f"the outcome is not of {joints} joints")
    return RecordedBody(
        first.tick,
        np.array([row.angles_rad for row in found]),
        np.array([row.rates_rad_s for row in found]),
        np.array([row.torques_nm for row in found]),
        ended,
    )


def _events(said: Channels, body: RecordedBody, joints: list[str]) -> list[Happened]:
    """What happened, each with its tick."""
    found = []
    told = said.tables(topics.EVENT)
    for place, row in zip(said.places(topics.EVENT), told, strict=True):
        event = to_event(row)
        check_event(event, joints)
        if place < len(body.torques_nm):
            found.append((body.first_tick + place, event))
    return found


def _answers(said: Channels, joints: Sequence[str], body: RecordedBody) -> dict[str, Any]:
    """What boards answered, by the names of the trajectory, each (R, N); and `said_tick`."""
    shape = len(body.torques_nm), len(joints)
    numbers, integers = _SAID
    found: dict[str, Any] = {name: np.full(shape, getattr(NOBODY, name), float) for name in numbers}
    found |= {name: np.full(shape, getattr(NOBODY, name), np.int64) for name in integers}
    found["said_tick"] = np.full(shape, NO_TICK, np.int64)
    for board, joint in enumerate(joints):
        topic = topics.torque(joint)
        told = said.rows(topic, rows.TorqueRow)
        places = np.array(said.places(topic), np.int64)
        known = places < shape[0]
        for name in (*numbers, *integers):
            column = np.array([getattr(row, name) for row in told], found[name].dtype)
            found[name][places[known], board] = column[known]
        ticks = np.array([row.tick for row in told], np.int64)
        found["said_tick"][places[known], board] = ticks[known]
    candidates = found["candidate"]
    if candidates.min() < NOBODY.candidate or candidates.max() >= len(joints):
        raise ValueError(f"a candidate is none of {len(joints)} boards")
    return found


def _trajectory(
    scenario: Scenario, body: RecordedBody, events: list[Happened], answers: dict[str, Any]
) -> Trajectory:
    said = {name: body.free(values) for name, values in answers.items() if name != "said_tick"}
    ended = body.ended
    return Trajectory(
        scenario=scenario,
        events=events,
        ending=ended.ending,
        wall_s=ended.wall_s,
        angles_rad=np.vstack([body.free(body.angles_rad), ended.angles_rad]),
        rates_rad_s=np.vstack([body.free(body.rates_rad_s), ended.rates_rad_s]),
        torques_nm=body.free(body.torques_nm),
        asked_nm=said.pop("torque_nm"),
        **said,
    )


def _plant_times(timings: Sequence[rows.PlantTimingRow], ticks: int, boards: int) -> PlantTimes:
    """Wall times of the ticks 0 ... T-1."""
    times = PlantTimes.unknown(ticks, boards)
    for row in timings:
        if len(row.answered_ns) != boards:
            raise ValueError(f"a wall time is not of {boards} joints")
        if 0 <= row.tick < ticks:
            times.opened_ns[row.tick] = row.opened_ns
            times.answered_ns[row.tick] = row.answered_ns
            times.closed_ns[row.tick] = row.closed_ns
    return times


def _timings(said: Channels, joints: Sequence[str]) -> list[tuple[int, Timing]]:
    """What each board told of its ticks."""
    return [
        (board, Timing(0, row.incarnation, row.tick, row.base_ns, row.clock, row.cpu_us,
                       row.memory_kb, tuple(map(_tick_timing, row.ticks))))
        for board, joint in enumerate(joints)
        for row in said.rows(topics.report(joint, Timing), rows.BoardTimingRow)
    ]  # fmt: skip


def _tick_timing(row: rows.BoardTickRow) -> TickTiming:
    return TickTiming(
        row.taken_up_us, row.decided_us, row.said_us, row.first_arrived_us, row.second_arrived_us
    )


def _epochs(said: Channels, run: Trajectory) -> Epochs | None:
    """Elections; None where nobody is elected."""
    if not run.scenario.election.enabled:
        return None
    found = said.rows(topics.EPOCH, rows.EpochRow)
    shape = len(found), len(run.joints)
    epochs = Epochs.unknown(*shape)
    for i, row in enumerate(found):
        members = [run.joints.index(joint) for joint in row.members]
        if not len(row.members) == len(row.w_rad) == len(row.known_after_rounds) == len(row.y):
            raise ValueError(f"epoch {row.epoch} is not of {len(row.members)} members")
        if not 0 <= row.began_tick <= row.tick < max(run.ticks, 1):
            raise ValueError(f"epoch {row.epoch} is not of {run.ticks} ticks")
        epochs.number[i] = row.epoch
        epochs.first_tick[i] = row.began_tick
        epochs.latch_tick[i] = row.tick
        epochs.agreed_after[i] = row.rounds_to_agreement
        epochs.members[i, members] = True
        epochs.w_rad[i, members] = row.w_rad
        epochs.known_after[i, members] = row.known_after_rounds
        epochs.enabled[i, members] = np.array(row.y) > 0
    return epochs


def _links(
    said: Channels,
    run: Trajectory,
    boards: BoardTimes,
    refused: Sequence[rows.LinkRefusedRow],
) -> dict[tuple[int, int], LinkHistory]:
    """The history of each directed link, by sender and receiver."""
    joints = run.joints
    return {
        (sender, receiver): _link(
            said.rows(topics.link(joints[sender], joints[receiver]), rows.LinkRow),
            run.ticks,
            sent=run.state[:, sender] > 0,
            sent_ns=boards.decided_ns[:, sender],
            arrived_ns=a_tick_later(boards.arrived_ns[:, receiver, place]),
            refused={
                one.reason: one.frames
                for one in refused
                if (one.sender, one.receiver) == (joints[sender], joints[receiver])
            },
        )
        for receiver in range(len(joints))
        for place, sender in enumerate(neighbours(receiver, len(joints)))
    }


def _link(told: Sequence[rows.LinkRow], ticks: int, **known: Any) -> LinkHistory:
    said_tick = np.array([row.tick for row in told], np.int64)
    free = (said_tick >= 0) & (said_tick < ticks)

    def by_tick(values: Sequence[int], unless: int) -> Integers:
        found = np.full(ticks, unless, np.int64)
        found[said_tick[free]] = np.array(values, np.int64)[free]
        return found

    heard_tick = by_tick([row.heard_tick for row in told], NOT_HEARD)
    fate = by_tick([FATES[row.fate] for row in told], FrameFate.UNSAID)
    return LinkHistory(
        fate=fate,
        heard_tick=np.where(heard_tick == NEVER, NOT_HEARD, heard_tick),
        frame_bytes=by_tick([row.frame_bytes for row in told], 0),
        **known,
    )


def _realtime(
    said: Channels, scenario: Scenario, said_tick: Integers, events: Sequence[Happened]
) -> RealtimeTimes | None:
    """How boards kept their time; None of a run in lockstep."""
    if cadence_of(scenario) is None:
        return None
    joints = scenario.joints
    lives = [_lives(said, joint, len(neighbours(i, len(joints)))) for i, joint in enumerate(joints)]
    pace = said.only(topics.PACE, rows.PaceRow)
    account = {} if pace is None else msgspec.structs.asdict(pace)
    return times_of(scenario, RealtimeRecord(lives, said_tick, events, account))


def _lives(said: Channels, joint: str, links: int) -> Lives:
    """Turns of one joint's boards, a list for each incarnation."""
    found: dict[int, list[TickTrace]] = {}
    for row in said.rows(topics.turn(joint), rows.TurnRow):
        if len(row.taken) != links:
            raise ValueError(f"turns of a board with {links} neighbours have others")
        taken = tuple(TakenFrames(link.newest_tick, link.before) for link in row.taken)
        found.setdefault(row.incarnation, []).append(
            TickTrace(row.slot, row.woke_us, row.late_us, row.busy_us, row.phase_us, row.seen_tick,
                  row.skipped, row.marks, taken)
        )  # fmt: skip
    return list(found.values())
