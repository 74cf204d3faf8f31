"""How far the pressure under the foot was from the edge of the sole.

The torque through the ankle puts the centre of pressure at -tau / F, forward of the ankle, with F
the weight on the foot, mean of the tick before (`foot`). All of it follows from what a
run records, so nothing more is recorded.
"""

from typing import NamedTuple

import numpy as np

from deploy.recording.trajectory import Floats, Trajectory
from plant_server.body.chain import GRAVITY_M_S2
from protocol.robot.events import Tipping
from protocol.robot.states import State

NOT_DRIVING = (0, int(State.SYNCING))
"""There is no board, or it does not drive yet: a brake may bear what nobody has measured."""


class FootMargin(NamedTuple):
    """How close the body came to tipping over its foot."""

    margin_min_m: float | None
    """Least distance of the centre of pressure from an edge; 0 while tipping."""
    tipping_ticks: int
    """Ticks in which the ankle asked for more than the sole can bear."""


def cop_m(run: Trajectory) -> Floats:
    """Centre of pressure in each tick, forward of the ankle, (T,); NaN while nobody drives it."""
    boards, passive = run.scenario.boards, run.scenario.boards[0].passive
    angle_rad, rate_rad_s = run.angles_rad[:-1, 0], run.rates_rad_s[:-1, 0]
    torque_nm = run.torques_nm[:, 0] - passive.damping_nm_s_rad * rate_rad_s
    torque_nm = torque_nm - passive.stiffness_nm_rad * (angle_rad - passive.rest_rad)
    driven = ~np.isin(run.state[:, 0], NOT_DRIVING)
    masses_kg = np.array([board.link.mass_kg for board in boards])
    with np.errstate(divide="ignore", invalid="ignore"):
        cop = -torque_nm / _weight_n(run, masses_kg)
    result: Floats = np.where(driven, cop, np.nan)
    return result


def margin_m(run: Trajectory) -> Floats | None:
    """Distance of the centre of pressure from the nearest edge in each tick, (T,).

    None without a foot. NaN where nobody drives the ankle.
    """
    foot = run.scenario.boards[0].foot
    if foot is None:
        return None
    cop = cop_m(run)
    margins_m: Floats = np.minimum(foot.ahead_m - cop, foot.behind_m + cop)
    return margins_m


def foot_margin(run: Trajectory) -> FootMargin | None:
    """Sum up a run; None without a foot."""
    margins_m = margin_m(run)
    if margins_m is None:
        return None
    known = margins_m[np.isfinite(margins_m)]
    least_m = max(0.0, float(known.min())) if len(known) else None
    return FootMargin(least_m, _tipping_ticks(run))


def _tipping_ticks(run: Trajectory) -> int:
    """From the plant's record of when it began and ended."""
    ticks, since = 0, None
    for tick, event in [*run.events, (run.ticks, Tipping(begins=False))]:
        if not isinstance(event, Tipping):
            continue
        if event.begins:
            since = tick
        elif since is not None:
            ticks, since = ticks + tick - since, None
    return ticks


def _weight_n(run: Trajectory, masses_kg: Floats) -> Floats:
    """Vertical force on the foot, mean of the tick before each, (T,)."""
    boards = run.scenario.boards
    coms_m = np.array([board.link.com_m for board in boards])
    lengths_m = np.array([board.link.length_m for board in boards])
    above_kg = masses_kg.sum() - np.cumsum(masses_kg)
    moments_kg_m = masses_kg * coms_m + lengths_m * above_kg
    rates_rad_s = np.cumsum(run.rates_rad_s, axis=1)
    rise_kg_m_s = -(moments_kg_m * np.sin(run.orientations_rad) * rates_rad_s).sum(axis=1)
    gained_n = np.diff(rise_kg_m_s, prepend=rise_kg_m_s[0])[:-1] / run.tick_s
    weight_n: Floats = masses_kg.sum() * GRAVITY_M_S2 + gained_n
    return weight_n
