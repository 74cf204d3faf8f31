"""The paper's movement does not depend on how the body is integrated."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from deploy.launch.twin import Twin
from deploy.scenario_file.load import load
from plant_server.body.body import Body


class AccurateBody(Body):
    """A body that an adaptive method of eighth order carries over each step."""

    def _runge_kutta(self, step_s: float) -> None:
        size, torques = self.chain.size, self.torques_nm

        def slope(_: float, state: NDArray[np.float64]) -> list[float]:
            angles, rates = state[:size].tolist(), state[size:].tolist()
            return [*rates, *self.chain.accelerations_rad_s2(angles, rates, torques)]

        start = [*self.angles_rad, *self.rates_rad_s]
        solution = solve_ivp(
            slope, (0.0, step_s), start, method="DOP853", rtol=1e-13, atol=1e-15, first_step=step_s
        )
        end = solution.y[:, -1].tolist()
        self.angles_rad, self.rates_rad_s = end[:size], end[size:]


@pytest.mark.parametrize("elections", ["true", "false"])
def test_the_fixed_step_follows_the_true_movement(elections: str) -> None:
    """After 1 s, through ten elections, every angle is right to 1e-9 rad.

    Two robots, each closing its own loop: torques are held over a tick in both, and only the
    integration within the tick differs. RK4's local error at 1 ms is some (20 rad/s h)^5 = 3e-9
    of what changes within a tick, and the controller damps what accumulates. 1e-9 rad is a ten
    thousandth of the smallest figure of the paper's table II, and a change of any election would
    be far larger.
    """
    scenario = load("paper", ["run.duration_s=1", f"election.enabled={elections}"])
    fixed, accurate = Twin(scenario), Twin(scenario)
    config = accurate.lockstep.plant.config
    accurate.lockstep.plant.body = AccurateBody(
        accurate.lockstep.plant.body.chain,
        initial_angles_rad=config.initial_angles_rad,
        tick_s=config.run.tick_s,
        substeps=1,
    )
    errors_rad = []
    for ours, theirs in zip(fixed.run(), accurate.run(), strict=True):
        assert _enabled(fixed) == _enabled(accurate)
        differences = np.subtract(ours.angles_rad, theirs.angles_rad)
        errors_rad.append(float(np.abs(differences).max()))
    ends = np.subtract(
        fixed.lockstep.plant.body.angles_rad, accurate.lockstep.plant.body.angles_rad
    )
    assert fixed.lockstep.plant.tick == accurate.lockstep.plant.tick == 1000
    assert max(errors_rad) > 0.0  # They are two integrations.
    assert max(*errors_rad, float(np.abs(ends).max())) < 1e-9


def _enabled(twin: Twin) -> list[bool]:
    return [board.enabled for board in twin.boards if board is not None]
