"""The margin of the foot, taken from what a run records."""

from functools import cache

import numpy as np
import pytest

from deploy.launch.twin import Twin
from deploy.outcome.foot_margin import cop_m, foot_margin, margin_m
from deploy.outcome.summary import summary
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from protocol.wire.frames import Observation, decode

SOLE = ("board.0.foot.ahead_m=0.2", "board.0.foot.behind_m=0.06")
PUSH = "event=[{at_s=0.2, do='push', segment='trunk', force_n=-300.0}]"


@cache
def played(*settings: str) -> tuple[Trajectory, tuple[float, ...]]:
    """A run, and what the ankle's force plate showed of the centre of pressure of each tick."""
    scenario = load("paper", ["run.duration_s=0.4", *settings])
    twin = Twin(scenario)
    records, shown = [], []
    for record in twin.run():
        records.append(record)
        shown.append(twin.lockstep.plant.body.foot_cop_m)
    run = trajectory(scenario, records, twin.lockstep.plant.outcome(1.0))
    return run, tuple(shown[-run.ticks :])


def test_without_a_foot_there_is_no_margin() -> None:
    run, _ = played()
    assert margin_m(run) is None
    assert foot_margin(run) is None
    assert summary(run, mode="twin")["foot"] is None


@pytest.mark.parametrize("stiffness", [0.0, 200.0])
def test_the_centre_of_pressure_is_the_one_that_the_force_plate_shows(stiffness: float) -> None:
    """But for the weight, which the plate has a tick later: some tenths of a millimetre."""
    run, shown = played(*SOLE, f"board.0.passive.stiffness_nm_rad={stiffness}")
    apart_m = np.abs(cop_m(run) - np.array(shown))[20:]
    assert apart_m.max() < 1e-3
    assert np.abs(np.array(shown)).max() > 5e-3


def test_the_margin_is_to_the_nearest_edge() -> None:
    run, _ = played(*SOLE)
    margins = margin_m(run)
    assert margins is not None
    cop = cop_m(run)
    assert (margins == np.minimum(0.2 - cop, 0.06 + cop)).all()
    found = foot_margin(run)
    assert found is not None
    assert found.margin_min_m == margins.min() > 0.0
    assert found.tipping_ticks == 0


def test_a_push_that_tips_it_is_counted_and_leaves_no_margin() -> None:
    run, _ = played(*SOLE, PUSH)
    margins = margin_m(run)
    assert margins is not None
    found = foot_margin(run)
    assert found is not None
    assert found.margin_min_m == pytest.approx(0.0, abs=1e-9)
    assert found.tipping_ticks == (margins < 1e-9).sum() > 0
    assert summary(run, mode="twin")["foot"] == found._asdict()


def test_what_a_brake_bears_is_not_known() -> None:
    settings = ("event=[{at_s=0.2, do='unplug', joint='ankle'}]", "unattended.how=braked")
    run, _ = played(*SOLE, *settings)
    margins = margin_m(run)
    assert margins is not None
    assert np.isfinite(margins[:200]).all()
    assert np.isnan(margins[200:]).all()


def test_the_ankles_force_plate_shows_what_the_body_has() -> None:
    twin = Twin(load("paper", ["run.duration_s=0.05", *SOLE]))
    for _ in range(40):
        twin.tick()
    observation = decode(Observation, next(iter(twin.lockstep.open()))[1])
    assert observation.readings.foot_cop_m == twin.lockstep.plant.body.foot_cop_m != 0.0
