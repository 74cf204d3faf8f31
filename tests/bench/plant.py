"""The plant alone beside other engines: the same body of three links, 1 ms a tick, and feedback.

The torques of each tick are computed in Python from the joint angles and rates at its start, as
boards would, so an engine has to show its state and take torques a thousand times a second. How far
its state is off after 1 s, from the same steps cut in fifty, says what the speed has cost.
"""

import time
from collections.abc import Callable, Sequence
from functools import cache, partial
from importlib.util import find_spec
from typing import Protocol

from deploy.scenario_file.load import load
from plant_server.body.body import Body
from plant_server.body.chain import Chain
from plant_server.session.config import PlantConfig, plant_config
from tests.bench.children import UnavailableError
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings

OURS, MUJOCO_RK4, MUJOCO_EULER = "decmesh, RK4", "MuJoCo, RK4", "MuJoCo, Euler"
PINOCCHIO, NUMPY, SOLVE_IVP = "Pinocchio ABA, RK4", "numpy, RK4", "scipy solve_ivp"
TICK_S = 1e-3
TICKS_COMPARED = 1000
SUBSTEPS_OF_TRUTH = 50
KP_NM_RAD = (600.0, 300.0, 100.0)
KD_NM_S_RAD = (120.0, 40.0, 20.0)


class Engine(Protocol):
    """A body of three links in the hands of some engine."""

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Joint angles and rates."""

    def step(self, torques_nm: Sequence[float]) -> None:
        """One tick under constant torques."""


class Ours:
    """`plant_server.body.body`."""

    def __init__(self, config: PlantConfig, substeps: int = 1) -> None:
        self._body = Body(
            Chain(config.links),
            initial_angles_rad=config.initial_angles_rad,
            tick_s=TICK_S,
            substeps=substeps,
        )
        self.step = self._body.step

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Joint angles and rates."""
        return self._body.angles_rad, self._body.rates_rad_s


def feedback(engine: Engine, ticks: int) -> None:
    """Hold the body upright by a spring and a damper in each joint."""
    state, step = engine.state, engine.step
    for _ in range(ticks):
        angles, rates = state()
        step(
            [
                -kp * angle - kd * rate
                for kp, kd, angle, rate in zip(KP_NM_RAD, KD_NM_S_RAD, angles, rates, strict=True)
            ]
        )


def config() -> PlantConfig:
    """The paper's body."""
    return plant_config(load("paper"))


@cache
def truth() -> tuple[float, ...]:
    """The joint angles after 1 s."""
    engine = Ours(config(), SUBSTEPS_OF_TRUTH)
    feedback(engine, TICKS_COMPARED)
    return tuple(engine.state()[0])


def drive(make: Callable[[PlantConfig], Engine], ticks: int) -> Figures:
    """How long a tick takes, and how far the state is off after 1 s."""
    engine = make(config())
    feedback(engine, TICKS_COMPARED)
    error = max(abs(a - b) for a, b in zip(engine.state()[0], truth(), strict=True))
    started_s = time.process_time()
    feedback(engine, ticks)
    return {"us_per_tick": 1e6 * (time.process_time() - started_s) / ticks, "error_rad": error}


def engine_of(
    name: str, needs: str | None = None, distribution: str = ""
) -> Callable[[PlantConfig], Engine]:
    """Find an engine in `tests.bench.engines`, if its library is here."""

    def make(config: PlantConfig) -> Engine:
        if needs is not None and find_spec(needs) is None:
            raise UnavailableError(f"{needs} is not installed; pip install {distribution or needs}")
        from tests.bench import engines  # noqa: PLC0415 - each engine loads its own library

        engine: Engine = getattr(engines, name)(config)
        return engine

    return make


def group(settings: Settings) -> Group:
    """One tick of the body, feedback included."""
    makes: dict[str, Callable[[PlantConfig], Engine]] = {
        OURS: Ours,
        MUJOCO_RK4: engine_of("mujoco_rk4", "mujoco"),
        MUJOCO_EULER: engine_of("mujoco_euler", "mujoco"),
        PINOCCHIO: engine_of("Pinocchio", "pinocchio", "pin"),
        NUMPY: engine_of("Numpy"),
        SOLVE_IVP: engine_of("SolveIvp"),
    }
    return Group(
        "plant",
        "the body alone, feedback from Python in every tick, CPU µs per tick",
        [Contender(name, partial(drive, make, settings.ticks)) for name, make in makes.items()],
        [Ratio(f"decmesh, of {name}", OURS, name, "us_per_tick") for name in makes if name != OURS],
    )
