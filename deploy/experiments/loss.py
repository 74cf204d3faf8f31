"""Studies: many runs of the twin over a grid of cases, as one table, one CSV file and one figure.

Rule 1: a case is a scenario, so every row can be had again with `decmesh run`, to the bit.
Rule 2: a study that is interrupted keeps the cases that are done.
Rule 3: files hold runs, one a row, in the order of the grid; tables and figures hold their means.

The loss study asks what random loss on every link does to agreement and to balance, for several
numbers of consensus rounds R. Balance has two figures. `standing_deg` is how far from upright the
body is once it has risen; it says whether the robot still does its work. `astray_deg` is how far
the motion is from the one without loss; it says whether loss is felt at all.
"""

import csv
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import groupby, product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from deploy.launch.twin import run_twin
from deploy.outcome.indices import NEVER, all_indices, elections, samples
from deploy.recording.trajectory import Floats, Trajectory, trajectory
from deploy.scenario_file.load import load
from plant_server.session.record import FELL
from protocol.robot.states import State

SCENARIO = "paper"
LOSSES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
ROUNDS = (2, 3, 5, 8)
STANDING_FROM_S = 2.0
"""The paper's body has risen by then; what follows is standing."""
CSV = "loss.csv"


class LossCase(NamedTuple):
    """One run of the loss study."""

    loss: float
    rounds: int
    seed: int
    duration_s: float

    @property
    def settings(self) -> list[str]:
        """What `--set` makes of the scenario to get this run."""
        return [
            f"link=[{{loss={self.loss}}}]",
            f"election.rounds={self.rounds}",
            f"run.seed={self.seed}",
            f"run.duration_s={self.duration_s}",
        ]


class LossResult(NamedTuple):
    """What came out of a case: a row of the CSV file."""

    loss: float
    rounds: int
    seed: int
    ending: str
    ended_s: float
    epochs: int
    agreed: int
    """Epochs after whose rounds every board knew the maximum."""
    several_enabled: int
    """Epochs after whose rounds more than one board was enabled."""
    standing_deg: float | None
    """Rms of the largest link angle from `STANDING_FROM_S` on; None if the run was over."""
    astray_deg: float
    """Rms of the largest distance of a link from where it is without loss, over the run."""
    settling_band_s: float | None
    """Of the top board's variable; None if it ended outside its band."""
    holding: float
    """Share of all boards' ticks in that state (S9), and so on."""
    extrapolating: float
    reckoning: float
    state_sha256: str


class Mean(NamedTuple):
    """All seeds of one loss and one R."""

    loss: float
    rounds: int
    runs: int
    fell: int
    epochs: int
    agreed: float
    """Share of the epochs."""
    several_enabled: float
    """Share of the epochs."""
    standing_deg: tuple[float, float, float] | None
    """Mean, least and most of the runs that did not fall; None if there is none."""
    astray_deg: tuple[float, float, float]
    settling_band_s: float | None
    """The latest; None if a run ended outside its band."""
    holding: float
    extrapolating: float
    reckoning: float


def grid(
    *,
    seeds: int,
    duration_s: float,
    losses: Sequence[float] = LOSSES,
    rounds: Sequence[int] = ROUNDS,
) -> list[LossCase]:
    """Every case of the loss study. Raises `ScenarioError` if the scenario cannot be so."""
    cases = product(range(1, seeds + 1), losses, rounds)
    found = [LossCase(loss, r, seed, duration_s) for seed, loss, r in cases]
    load(SCENARIO, found[0].settings)
    return found


def measure(case: LossCase) -> LossResult:
    """Run one case in the twin."""
    run = _run(case)
    held = elections(run)
    assert held is not None, "the scenario elects"
    top = all_indices(run)[_TOP]
    return LossResult(
        case.loss,
        case.rounds,
        case.seed,
        run.ending,
        run.ticks * run.tick_s,
        held.epochs,
        held.epochs - held.rounds_to_agreement[NEVER],
        held.enabled_2_or_more,
        _standing_deg(run),
        _rms_deg(_apart_rad(run, case)),
        top.settling_band_s,
        _share(run, State.HOLDING),
        _share(run, State.EXTRAPOLATING),
        _share(run, State.RECKONING),
        run.state_sha256,
    )


def write_csv(results: Iterable[LossResult], path: Path) -> None:
    """Write one row per run. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(LossResult._fields)
        writer.writerows(_in_order(results))


def means(results: Iterable[LossResult]) -> Iterator[Mean]:
    """Sum up the seeds of each loss and R, in the order of the grid."""
    for (loss, rounds), group in groupby(
        _in_order(results), key=lambda run: (run.loss, run.rounds)
    ):
        runs = list(group)
        epochs = sum(run.epochs for run in runs)
        elections_held = max(1, epochs)
        stood = [run.standing_deg for run in runs if run.ending != FELL]
        settled = [run.settling_band_s for run in runs]
        yield Mean(
            loss,
            rounds,
            len(runs),
            sum(run.ending == FELL for run in runs),
            epochs,
            sum(run.agreed for run in runs) / elections_held,
            sum(run.several_enabled for run in runs) / elections_held,
            _spread([value for value in stood if value is not None]),
            _spread([run.astray_deg for run in runs]) or (0.0, 0.0, 0.0),
            None if None in settled else max(value for value in settled if value is not None),
            sum(run.holding for run in runs) / len(runs),
            sum(run.extrapolating for run in runs) / len(runs),
            sum(run.reckoning for run in runs) / len(runs),
        )


_TOP = "TS"


def _run(case: LossCase) -> Trajectory:
    scenario = load(SCENARIO, case.settings)
    return trajectory(scenario, *run_twin(scenario))


@cache
def _without_loss_rad(case: LossCase) -> Floats:
    return samples(_run(case)).orientations_rad


def _apart_rad(run: Trajectory, case: LossCase) -> Floats:
    """How far the link that is farthest is from its place in the run without loss, per sample."""
    # Without loss nothing is drawn, so any seed will do.
    there_rad = _without_loss_rad(case._replace(loss=0.0, seed=1))
    here_rad = samples(run).orientations_rad
    both = min(len(there_rad), len(here_rad))
    apart_rad: Floats = np.abs(here_rad[:both] - there_rad[:both]).max(axis=1)
    return apart_rad


def _share(run: Trajectory, state: State) -> float:
    """Share of all boards' ticks in a state."""
    return float(np.mean(run.state == state))


def _standing_deg(run: Trajectory) -> float | None:
    found = samples(run)
    standing = found.times_s >= STANDING_FROM_S
    if not standing.any():
        return None
    return _rms_deg(np.abs(found.orientations_rad[standing]).max(axis=1))


def _rms_deg(values_rad: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean(values_rad**2))))


def _spread(values: Sequence[float]) -> tuple[float, float, float] | None:
    return (sum(values) / len(values), min(values), max(values)) if values else None


def _in_order(results: Iterable[LossResult]) -> list[LossResult]:
    return sorted(results, key=lambda result: (result.loss, result.rounds, result.seed))
