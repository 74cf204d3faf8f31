"""A run as arrays: what every index, figure and table is made from."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plant_server.session.record import Outcome, TickRecord
from plant_server.spool.spool import Spool
from protocol.robot.events import Event
from protocol.robot.scenario import Scenario
from protocol.wire.frames import NO_EPOCH, TorqueFrame, decode

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


CUT_OFF = "cut off"
"""The ending of a run whose recording does not say how it ended."""
NOBODY = TorqueFrame(0, 0, 0, 0.0, 0, 0, 0.0, NO_EPOCH, 0, 0.0, -1, 0, 0, ())
"""What a joint without a board says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """A run of T ticks with N joints, from the ground up; warm-up excluded.

    States are those at the start of a tick, and one more after the last; the rest is per tick.
    """

    scenario: Scenario
    """Values of the resolved scenario."""
    events: list[tuple[int, Event]]
    """What happened to the robot, with its tick; boards that came in warm-up have negative ones."""
    ending: str
    wall_s: float
    angles_rad: Floats
    """Joint angles, (T + 1, N)."""
    rates_rad_s: Floats
    """Joint rates, (T + 1, N)."""
    torques_nm: Floats
    """Torques applied to the joints, (T, N)."""
    asked_nm: Floats
    """Torques that the boards asked for, which may be no numbers; 0 where there is none, (T, N)."""
    controlled_rad: Floats
    """Each board's controlled variable, one lumped delay old, (T, N)."""
    state: Integers
    """Each board's `protocol.robot.states.State`; 0 where there is no board, (T, N)."""
    enabled: Integers
    """The enabling variables y, (T, N)."""
    epoch: Integers
    """Epoch that each board is in, -1 before the first or without elections, (T, N)."""
    round: Integers
    """Consensus round that each board has completed in that epoch, (T, N)."""
    urgency: Floats
    """Largest urgency that each board knows of; at round 0 its own w, (T, N)."""
    candidate: Integers
    """Index of the board whose urgency that is, (T, N)."""

    @property
    def ticks(self) -> int:
        """T: how many ticks the body was free."""
        return len(self.torques_nm)

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        return self.scenario.joints

    @property
    def tick_s(self) -> float:
        """Length of a tick."""
        return float(self.scenario.run.tick_s)

    @property
    def times_s(self) -> Floats:
        """Time of each state since the release, (T + 1,)."""
        return np.arange(self.ticks + 1, dtype=np.float64) * self.tick_s

    @property
    def orientations_rad(self) -> Floats:
        """Orientations of the links in space, from the vertical, forward positive, (T + 1, N)."""
        return np.cumsum(self.angles_rad, axis=1)

    @property
    def state_sha256(self) -> str:
        """Digest of the motion: per tick angles, rates, torques; then the last state (S20)."""
        ticks = np.hstack([self.angles_rad[:-1], self.rates_rad_s[:-1], self.torques_nm])
        last = np.hstack([self.angles_rad[-1], self.rates_rad_s[-1]])
        digest = hashlib.sha256(ticks.astype("<f8").tobytes())
        digest.update(last.astype("<f8").tobytes())
        return digest.hexdigest()


def trajectory(scenario: Scenario, records: Sequence[TickRecord], outcome: Outcome) -> Trajectory:
    """Turn the records of a run, warm-up included, into arrays."""
    free = [record for record in records if 0 <= record.tick < outcome.tick]
    joints = len(scenario.boards)
    said = [
        [decode(TorqueFrame, answer) if answer else NOBODY for answer in record.answers]
        for record in free
    ]

    def states(name: str, last: tuple[float, ...]) -> Floats:
        return np.array([*(getattr(record, name) for record in free), last], dtype=np.float64)

    def floats(name: str) -> Floats:
        values = [[getattr(frame, name) for frame in frames] for frames in said]
        return np.array(values, dtype=np.float64).reshape(-1, joints)

    def integers(name: str) -> Integers:
        values = [[getattr(frame, name) for frame in frames] for frames in said]
        return np.array(values, dtype=np.int64).reshape(-1, joints)

    return Trajectory(
        scenario=scenario,
        events=[(record.tick, event) for record in records for event in record.events],
        ending=outcome.ending,
        wall_s=outcome.wall_s,
        angles_rad=states("angles_rad", outcome.angles_rad),
        rates_rad_s=states("rates_rad_s", outcome.rates_rad_s),
        torques_nm=np.array([record.torques_nm for record in free]).reshape(-1, joints),
        asked_nm=floats("torque_nm"),
        controlled_rad=floats("controlled_rad"),
        state=integers("state"),
        enabled=integers("enabled"),
        epoch=integers("epoch"),
        round=integers("round"),
        urgency=floats("urgency"),
        candidate=integers("candidate"),
    )


def recorded_trajectory(spool: Spool) -> Trajectory:
    """Turn a recording into arrays, also one that was cut off.

    What the last tick before a cut led to is not known, so that tick has no part in it.
    """
    return trajectory(spool.scenario, spool.ticks, spool.outcome or _cut_off(spool))


def _cut_off(spool: Spool) -> Outcome:
    last = spool.ticks[-1]
    wall_s = cut_off_s(last.tick, [walls.opened_ns for walls in spool.walls if walls is not None])
    return Outcome(last.tick, last.angles_rad, last.rates_rad_s, CUT_OFF, wall_s)


def cut_off_s(last_tick: int, opened_ns: Sequence[int]) -> float:
    """Wall time from the release to the last tick, of times of ticks; 0: not known."""
    if last_tick <= 0 or len(opened_ns) <= last_tick:
        return 0.0
    return (opened_ns[-1] - opened_ns[-1 - last_tick]) / 1e9
