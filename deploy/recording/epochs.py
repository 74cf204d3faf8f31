"""Elections, epoch by epoch: what each board began with, when it knew the maximum, what came of it.

Rule 1: an epoch counts when its last round was played before the run ended.
Rule 2: only boards that began an epoch have a say in it; the others are no members of it.
Rule 3: to know the maximum is to know the largest urgency, and whose it is, of what the members
        began with (eq. achievedMaxCons); ties go to the higher board.
Rule 4: in realtime there is no barrier, and so no tick in which all have played a round. Boards are
        compared at the end of an epoch, when all have long decided; its members are those that were
        in it then, and the maximum is the largest that any of them ever knew.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from deploy.recording.trajectory import Floats, Integers, Trajectory
from protocol.robot.cadence import cadence_of
from protocol.robot.scenario import Scenario

NOT_KNOWN = -1
"""In place of a number of rounds: not within the epoch's rounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Epochs:
    """E epochs that had members, of N boards."""

    number: Integers
    """Which epoch it is, (E,)."""
    first_tick: Integers
    """When it began, (E,)."""
    latch_tick: Integers
    """When its last round was over and the boards decided; in realtime its last tick, (E,)."""
    members: NDArray[np.bool_]
    """(E, N)."""
    w_rad: Floats
    """What each member began with (the paper's w); NaN for others, (E, N)."""
    known_after: Integers
    """After how many rounds each member knew the maximum, or `NOT_KNOWN`, (E, N)."""
    agreed_after: Integers
    """After how many rounds all members knew it, or `NOT_KNOWN`, (E,)."""
    enabled: NDArray[np.bool_]
    """Which members were enabled after the last round, (E, N)."""

    @classmethod
    def unknown(cls, epochs: int, boards: int) -> Self:
        """So many epochs without members, to be filled in."""
        shape = epochs, boards
        return cls(
            number=np.zeros(epochs, np.int64),
            first_tick=np.zeros(epochs, np.int64),
            latch_tick=np.zeros(epochs, np.int64),
            members=np.zeros(shape, np.bool_),
            w_rad=np.full(shape, np.nan),
            known_after=np.full(shape, NOT_KNOWN, np.int64),
            agreed_after=np.full(epochs, NOT_KNOWN, np.int64),
            enabled=np.zeros(shape, np.bool_),
        )

    @property
    def enabled_boards(self) -> Integers:
        """How many members were enabled after the last round, (E,)."""
        boards: Integers = self.enabled.sum(axis=1, dtype=np.int64)
        return boards


def epochs(trajectory: Trajectory) -> Epochs | None:
    """Find the epochs of a run; None when nobody is elected."""
    election = trajectory.scenario.election
    if not election.enabled:
        return None
    if cadence_of(trajectory.scenario) is not None:
        return _without_barrier(trajectory)
    rounds = election.rounds
    first = np.arange(0, trajectory.ticks - rounds, election.period_ticks, dtype=np.int64)
    number = np.arange(len(first))
    begun = (trajectory.epoch[first] == number[:, None]) & (trajectory.round[first] == 0)
    held = begun.any(axis=1)
    number, first, members = number[held], first[held], begun[held]
    known = _known(trajectory, number, first[:, None] + np.arange(rounds + 1), members)
    return Epochs(
        number=number,
        first_tick=first,
        latch_tick=first + rounds,
        members=members,
        w_rad=np.where(members, trajectory.urgency[first], np.nan),
        known_after=np.where(members, _first(known), NOT_KNOWN),
        agreed_after=_first((known | ~members[:, None]).all(axis=2)),
        enabled=members & (trajectory.enabled[first + rounds] > 0),
    )


def _known(
    trajectory: Trajectory, number: Integers, ticks: Integers, members: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether each board knew the maximum after each round, (E, R + 1, N); `ticks` (E, R + 1)."""
    urgency, candidate = trajectory.urgency[ticks], trajectory.candidate[ticks]
    began = np.where(members, urgency[:, 0], -np.inf)
    most = began.max(axis=1, keepdims=True)
    whose = np.where(began == most, candidate[:, 0], -1).max(axis=1, keepdims=True)
    same_epoch = trajectory.epoch[ticks] == number[:, None, None]
    knows = (urgency == most[:, None]) & (candidate == whose[:, None])
    known: NDArray[np.bool_] = knows & same_epoch
    return known


def _first(known: NDArray[np.bool_]) -> Integers:
    """Along axis 1, the first that is so, or `NOT_KNOWN`."""
    return np.where(known.any(axis=1), known.argmax(axis=1), NOT_KNOWN)


def epochs_played(scenario: Scenario, ticks: int) -> int | None:
    """Epochs in realtime that had time for all their rounds, and one more to tell of it."""
    election, cadence = scenario.election, cadence_of(scenario)
    if not election.enabled or cadence is None:
        return None
    period, rounds = election.period_ticks, election.rounds
    return max(0, (ticks - (rounds + 1) * cadence.ticks_per_round) // period + 1)


def _without_barrier(trajectory: Trajectory) -> Epochs:
    """Boards reckon the plant's tick, so one may begin an epoch, and leave it, some ticks early."""
    period = trajectory.scenario.election.period_ticks
    cadence = cadence_of(trajectory.scenario)
    assert cadence is not None
    early = cadence.ticks_per_round // 2
    number = np.arange(epochs_played(trajectory.scenario, trajectory.ticks) or 0, dtype=np.int64)
    latch = np.minimum((number + 1) * period, trajectory.ticks) - 1 - early
    members = trajectory.epoch[latch] == number[:, None]
    held = members.any(axis=1)
    number, latch, members = number[held], latch[held], members[held]
    w_rad = np.full(members.shape, np.nan)
    known_after = np.full(members.shape, NOT_KNOWN, np.int64)
    for row, (epoch, last) in enumerate(zip(number, latch, strict=True)):
        window = slice(max(0, int(epoch) * period - early), int(last) + 1)
        w_rad[row], known_after[row] = _heard(trajectory, window, int(epoch), members[row])
    everybody = (known_after != NOT_KNOWN) | ~members
    return Epochs(
        number=number,
        first_tick=number * period,
        latch_tick=latch,
        members=members,
        w_rad=w_rad,
        known_after=known_after,
        agreed_after=np.where(everybody.all(axis=1), known_after.max(axis=1), NOT_KNOWN),
        enabled=members & (trajectory.enabled[latch] > 0),
    )


def _heard(
    trajectory: Trajectory, window: slice, epoch: int, members: NDArray[np.bool_]
) -> tuple[Floats, Integers]:
    """Each member's own w, NaN if nobody heard of it, and after which round it knew the maximum."""
    spoke = (trajectory.epoch[window] == epoch) & members
    urgency = np.where(spoke, trajectory.urgency[window], -np.inf)
    candidate, rounds = trajectory.candidate[window], trajectory.round[window]
    most = urgency.max()
    whose = candidate[urgency == most].max()
    knows = spoke & (urgency == most) & (candidate == whose)
    began = spoke & (rounds == 0) & (candidate == np.arange(len(members)))
    first = began.argmax(axis=0), np.arange(len(members))
    w_rad: Floats = np.where(began.any(axis=0), trajectory.urgency[window][first], np.nan)
    when = knows.argmax(axis=0), np.arange(len(members))
    after: Integers = np.where(knows.any(axis=0), rounds[when], NOT_KNOWN)
    return w_rad, after
