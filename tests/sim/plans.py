"""What a seed stands for: a body, an election, standing faults, and how often things go wrong.

Rates are drawn from few values, zero among them, so that seeds differ in kind and not in degree
only: some have nothing but deaths, some nothing but noise, some everything.
"""

import json
from functools import cache
from random import Random
from typing import Any, NamedTuple

from deploy.scenario_file.load import load
from protocol.robot.commands import DELAY_TICKS_MAX
from protocol.robot.scenario import ResolvedScenario, resolved

RUN_TICKS = 100_000
"""The simulator ends a run, never the scenario."""
BOARD_TICKS = 180
"""How many ticks of a board are played with faults on; a body of more boards gets fewer ticks."""
PROBABILITIES = (
    "loss",
    "burst_start",
    "burst_end",
    "burst_loss",
    "duplicate",
    "reorder",
    "corrupt",
)


class Rates(NamedTuple):
    """Probabilities per tick; those of boards are per board and tick."""

    command: float
    death: float
    silence: float
    """A board freezes, and the plant loses patience with it."""
    wake: float
    enrol: float
    """A new board comes for a joint that has none."""
    blindness: float
    """Sensors of a board say nothing plausible for a while."""
    garbage: float
    """Per board: bytes from nobody arrive."""


class Plan(NamedTuple):
    """Everything that is drawn before the first tick."""

    seed: int
    scenario: ResolvedScenario
    rates: Rates
    faulty_ticks: int


@cache
def _paper() -> str:
    return json.dumps(load("paper").values)


def link_changes(chance: Random) -> dict[str, float]:
    """Some parameters of a link, of all kinds."""
    found: dict[str, float] = {}
    for name in PROBABILITIES:
        if chance.random() < 0.25:
            found[name] = chance.choice((0.0, 0.05, 0.3, 1.0))
    if chance.random() < 0.3:
        found["delay_ticks"] = float(chance.choice((0, 1, 2, 5, DELAY_TICKS_MAX)))
    if chance.random() < 0.3:
        found["jitter_ticks"] = float(chance.choice((0, 1, 3, DELAY_TICKS_MAX)))
    if chance.random() < 0.2:
        found["cut"] = 1.0
    return found


def plan(seed: int) -> Plan:
    """Draw the plan of a seed."""
    chance = Random(f"plan {seed}")
    size = chance.choice((1, 2, 2, 3, 3, 3, 4, 4, 5, 6))
    values: dict[str, Any] = json.loads(_paper())
    rounds = max(1, size - 1) + chance.choice((0, 0, 1, 3))
    values["name"] = "sim"
    values["run"] |= {
        "seed": chance.randrange(2**63),
        "ticks": RUN_TICKS,
        "tick_s": chance.choice((0.001, 0.001, 0.002, 0.004)),
    }
    values["election"] |= {
        "period_ticks": rounds + chance.randint(1, 8),
        "rounds": rounds,
        "disabled_holds": chance.choice(("controlled-variable", "link-orientation")),
        "incomplete": chance.choice(("each-side", "keep-last")),
    }
    values["board"] = [
        _board(values["board"], index, size=size, chance=chance) for index in range(size)
    ]
    values["link_names"] = [f"link{index}" for index in range(size)]
    values["link"] = [
        [sender, receiver, link_changes(chance)]
        for sender in range(size)
        for receiver in (sender - 1, sender + 1)
        if 0 <= receiver < size and chance.random() < 0.1
    ]
    return Plan(seed, resolved(values), _rates(chance), BOARD_TICKS // size + 20)


def _board(paper: list[dict[str, Any]], index: int, *, size: int, chance: Random) -> dict[str, Any]:
    template = paper[2] if index == size - 1 else paper[min(index, 1)]
    board: dict[str, Any] = json.loads(json.dumps(template))
    board["joint"] = f"joint{index}"
    board["controls"] = chance.choice(("body-sway", "joint-angle", "link-orientation"))
    board["imu"] = index == size - 1 or chance.random() < 0.2
    board["reference_rad"] = chance.uniform(-0.1, 0.1)
    board["initial_rad"] = chance.uniform(-0.3, 0.3)
    board["lumped_delay_ticks"] = size - 1 + chance.randint(0, 6)
    board["unattended"] = {
        "how": chance.choice(("limp", "braked", "passive")),
        "stiffness_nm_rad": 100.0,
        "damping_nm_s_rad": 5.0,
    }
    return board


def _rates(chance: Random) -> Rates:
    return Rates(
        command=chance.choice((0.0, 0.03, 0.1, 0.5)),
        death=chance.choice((0.0, 0.0, 0.003, 0.02)),
        silence=chance.choice((0.0, 0.0, 0.003, 0.02)),
        wake=chance.choice((0.05, 0.5)),
        enrol=chance.choice((0.05, 0.3, 1.0)),
        blindness=chance.choice((0.0, 0.0, 0.005)),
        garbage=chance.choice((0.0, 0.1, 0.5)),
    )
