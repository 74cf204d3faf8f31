"""What a run is judged by: the indices of the paper's Table II, energies, and its elections.

Rule 1: indices come from 100 Hz samples 0, 0.01, ... T - 0.01 s, as in the paper (S21). A time is
        therefore that of a sample; nothing is interpolated.
Rule 2: what never happened is None, never 0 and never NaN.
Rule 3: a body that fell may end in a state that is no number. Whatever comes after the last state
        that is one does not count.

Overshoot and rise are measured along the way from the start to the reference, so a motion and its
mirror image have the same indices.
"""

from collections import Counter
from collections.abc import Sequence
from math import degrees, floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deploy.recording.epochs import NOT_KNOWN, Epochs, epochs
from deploy.recording.trajectory import Floats, Integers, Trajectory
from protocol.robot.scenario import BoardSettings

SAMPLES_PER_S = 100
BAND = 0.02
"""Settled: within this share of the largest error, or, as the paper has it, of the last value."""
AT_REFERENCE_RAD = 1e-9
"""A start this close to the reference is a start at the reference: no way, so no side beyond it."""
NEVER = "never"
ABBREVIATIONS = {"shank": "SS", "thigh": "THS", "trunk": "TS"}
"""The paper's names for the orientations of its links in space."""


class Samples(NamedTuple):
    """The body at 100 Hz, S samples of N links."""

    times_s: Floats
    """(S,), from 0."""
    states: Integers
    """Index into the states of the trajectory, (S,): the nearest one when 10 ms is no tick."""
    orientations_rad: Floats
    """Links in space, from the vertical, forward positive, (S, N)."""


class Variable(NamedTuple):
    """A controlled variable and where it should go."""

    name: str
    reference_rad: float
    values_rad: Floats
    """(S,)."""


class Indices(NamedTuple):
    """Dynamic performance of one controlled variable."""

    overshoot_deg: float | None
    """Largest excursion past the reference; 0 if none, None if it started at the reference."""
    rise_s: float | None
    """The first sample at or past the reference."""
    rise_90_s: float | None
    """The first sample that has nine tenths of the way behind it."""
    settling_paper_s: float
    """The sample after the last one that is more than 2 % of the last value away from it.

    This is the index code that the paper's first author has published, to the letter. Where the
    last value is about 0 it gives the last sample, whatever the motion: 9.99 s of 10 s.
    """
    settling_band_s: float | None
    """The last sample outside 2 % of the largest error; None if the run ends outside."""


class Energy(NamedTuple):
    """Mechanical work of all joints over the run, in joules."""

    positive: float
    """Sum over the joints of the integral of max(torque x rate, 0)."""
    absolute: float
    """Sum over the joints of the integral of |torque x rate|."""
    net: float
    """Sum over the joints of the integral of torque x rate, with its sign."""


class Elections(NamedTuple):
    """What the boards agreed on, epoch by epoch."""

    epochs: int
    """Elections whose last round was played before the run ended."""
    rounds_to_agreement: dict[str, int]
    """How many epochs took so many rounds until all boards knew the maximum; `never`: not within R.
    """
    enabled_0: int
    """Epochs after whose last round no board was enabled."""
    enabled_1: int
    """Epochs after whose last round one board was enabled, as it should be."""
    enabled_2_or_more: int
    """Epochs after whose last round several boards were enabled."""


def samples(trajectory: Trajectory) -> Samples:
    """Sample the body at 100 Hz while its state is finite; the start is always there."""
    with np.errstate(over="ignore", invalid="ignore"):
        orientations_rad = trajectory.orientations_rad
    known = _leading(np.all(np.isfinite(orientations_rad), axis=1))
    duration_s = trajectory.ticks * trajectory.tick_s
    count = max(1, floor(duration_s * SAMPLES_PER_S + AT_REFERENCE_RAD))
    times_s = np.arange(count) / SAMPLES_PER_S
    states = np.rint(times_s / trajectory.tick_s).astype(np.int64)
    kept = _leading(states < known)
    return Samples(times_s[:kept], states[:kept], orientations_rad[states[:kept]])


def joint_positions_m(boards: Sequence[BoardSettings], orientations_rad: Floats) -> Floats:
    """Joints and, last, the tip: (S, N + 1, 2), forward and up from the lowest of `boards`."""
    lengths_m = np.array([board.link.length_m for board in boards])
    ends_m = np.cumsum(lengths_m[:, None] * _directions(orientations_rad), axis=1)
    return np.concatenate([np.zeros_like(ends_m[:, :1]), ends_m], axis=1)


def com_m(boards: Sequence[BoardSettings], orientations_rad: Floats) -> Floats:
    """Centre of mass of the links of `boards`, seen from the lowest of their joints, (S, 2)."""
    masses_kg = np.array([board.link.mass_kg for board in boards])
    coms_m = np.array([board.link.com_m for board in boards])
    lower_m = joint_positions_m(boards, orientations_rad)[:, :-1]
    centres_m = lower_m + coms_m[:, None] * _directions(orientations_rad)
    centre: Floats = (masses_kg[:, None] * centres_m).sum(axis=1) / masses_kg.sum()
    return centre


def controlled_variables(trajectory: Trajectory) -> list[Variable]:
    """What each board controls, from the top down as the paper prints it: TS, KNEE, BS."""
    boards, orientations_rad = trajectory.scenario.boards, samples(trajectory).orientations_rad
    variables: dict[str, Variable] = {}
    for i, board in reversed(list(enumerate(boards))):
        values_rad = _controlled_rad(boards, orientations_rad, i)
        name = _name(board.controls, board.joint, trajectory.scenario.link_names[i], i)
        if name in variables:
            name = f"{board.joint}/{board.controls}"
        variables[name] = Variable(name, board.reference_rad, values_rad)
    return list(variables.values())


def indices(times_s: Floats, variable: Variable) -> Indices:
    """Judge one controlled variable (paper, Table II)."""
    error_rad = variable.values_rad - variable.reference_rad
    last_rad = variable.values_rad[-1]
    to_last_rad = np.abs(variable.values_rad - last_rad)
    band_rad = max(BAND * np.abs(error_rad).max(), AT_REFERENCE_RAD)
    outside = np.abs(error_rad) > band_rad
    return Indices(
        *_approach(times_s, error_rad),
        settling_paper_s=_after_last(times_s, to_last_rad > BAND * abs(last_rad)),
        settling_band_s=None if outside[-1] else _last(times_s, outside),
    )


def all_indices(trajectory: Trajectory) -> dict[str, Indices]:
    """Judge every controlled variable, by name."""
    times_s = samples(trajectory).times_s
    return {
        variable.name: indices(times_s, variable) for variable in controlled_variables(trajectory)
    }


def energy(trajectory: Trajectory) -> Energy:
    """Add up the work of all joints over all ticks.

    The torque is held during a tick, so its work in it is exactly torque x (q' - q). Positive and
    absolute work are exact too, but for ticks in which a joint turns round.
    """
    known = _leading(np.all(np.isfinite(trajectory.angles_rad), axis=1))
    work_j = trajectory.torques_nm[: max(known - 1, 0)] * np.diff(
        trajectory.angles_rad[:known], axis=0
    )
    positive_j = float(np.maximum(work_j, 0.0).sum())
    return Energy(positive_j, float(np.abs(work_j).sum()), float(work_j.sum()))


def elections(trajectory: Trajectory) -> Elections | None:
    """Count rounds to agreement and enabled boards per epoch; None when nobody is elected.

    Agreement is the first round after which all members of an epoch know its maximum.
    """
    found = epochs(trajectory)
    return None if found is None else counted(found)


def counted(found: Epochs) -> Elections:
    """The same of epochs that are known already."""
    taken = Counter(found.agreed_after.tolist())
    enabled = Counter(found.enabled_boards.tolist())
    return Elections(
        epochs=len(found.number),
        rounds_to_agreement={
            **{str(rounds): taken[rounds] for rounds in sorted(taken) if rounds != NOT_KNOWN},
            NEVER: taken[NOT_KNOWN],
        },
        enabled_0=enabled[0],
        enabled_1=enabled[1],
        enabled_2_or_more=len(found.number) - enabled[0] - enabled[1],
    )


def _approach(
    times_s: Floats, error_rad: Floats
) -> tuple[float | None, float | None, float | None]:
    """Overshoot in degrees, rise and 90 % rise in seconds."""
    start_rad = error_rad[0]
    if abs(start_rad) <= AT_REFERENCE_RAD:
        return None, 0.0, 0.0
    past_rad = -np.sign(start_rad) * error_rad
    return (
        max(0.0, degrees(past_rad.max())),
        _first(times_s, past_rad >= 0.0),
        _first(times_s, past_rad >= -0.1 * abs(start_rad)),
    )


def _controlled_rad(
    boards: Sequence[BoardSettings], orientations_rad: Floats, board: int
) -> Floats:
    link_rad: Floats = orientations_rad[:, board]
    match boards[board].controls:
        case "body-sway":
            x_m, y_m = com_m(boards[board:], orientations_rad[:, board:]).T
            sway_rad: Floats = np.arctan2(x_m, y_m)
            return sway_rad
        case "joint-angle":
            return link_rad - orientations_rad[:, board - 1] if board else link_rad
        case _:
            return link_rad


def _name(controls: str, joint: str, link: str, board: int) -> str:
    match controls:
        case "body-sway":
            return f"BS_{joint.upper()}" if board else "BS"
        case "joint-angle":
            return joint.upper()
        case _:
            return ABBREVIATIONS.get(link, f"{joint.upper()}_LINK")


def _directions(orientations_rad: Floats) -> Floats:
    return np.stack([np.sin(orientations_rad), np.cos(orientations_rad)], axis=-1)


def _leading(true: NDArray[np.bool_]) -> int:
    """How many values are true before the first that is not."""
    return len(true) if true.all() else int(true.argmin())


def _first(times_s: Floats, where: NDArray[np.bool_]) -> float | None:
    return float(times_s[where.argmax()]) if where.any() else None


def _last(times_s: Floats, where: NDArray[np.bool_]) -> float:
    """The time of the last sample that is so; 0 if none is."""
    return float(times_s[where][-1]) if where.any() else 0.0


def _after_last(times_s: Floats, where: NDArray[np.bool_]) -> float:
    """The time of the sample after the last that is so, if there is one; 0 if none is so."""
    if not where.any():
        return 0.0
    return float(times_s[min(int(np.flatnonzero(where)[-1]) + 1, len(times_s) - 1)])
