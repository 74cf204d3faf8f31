"""What a seed stands for: a body, an election, standing faults, and how often things go wrong.

Rates are drawn from few values, zero among them, so that seeds differ in kind and not in degree
only: some have nothing but deaths, some nothing but noise, some everything.
"""

from functools import cache
from random import Random
from typing import NamedTuple

from msgspec.structs import replace

from deploy.scenario_file.load import load
from protocol.robot.events import DELAY_TICKS_MAX
from protocol.robot.hardware import UnattendedJoint
from protocol.robot.scenario import BoardSettings, Controls, LinkFaults, Scenario

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
    scenario: Scenario
    rates: Rates
    faulty_ticks: int


@cache
def _paper() -> Scenario:
    return load("paper")


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
    paper = _paper()
    rounds = max(1, size - 1) + chance.choice((0, 0, 1, 3))
    run = replace(
        paper.run,
        seed=chance.randrange(2**63),
        ticks=RUN_TICKS,
        tick_s=chance.choice((0.001, 0.001, 0.002, 0.004)),
    )
    election = replace(
        paper.election,
        period_ticks=rounds + chance.randint(1, 8),
        rounds=rounds,
        disabled_holds=chance.choice(("controlled-variable", "link-orientation")),
        incomplete=chance.choice(("each-side", "keep-last")),
    )
    boards = tuple(_board(paper, index, size=size, chance=chance) for index in range(size))
    scenario = replace(
        paper,
        name="sim",
        run=run,
        election=election,
        boards=boards,
        link_names=tuple(f"link{index}" for index in range(size)),
        link_faults=tuple(
            LinkFaults(sender, receiver, link_changes(chance))
            for sender in range(size)
            for receiver in (sender - 1, sender + 1)
            if 0 <= receiver < size and chance.random() < 0.1
        ),
    )
    return Plan(seed, scenario, _rates(chance), BOARD_TICKS // size + 20)


def _board(paper: Scenario, index: int, *, size: int, chance: Random) -> BoardSettings:
    template = paper.boards[2 if index == size - 1 else min(index, 1)]
    return replace(
        template,
        joint=f"joint{index}",
        controls=chance.choice(tuple(Controls)),
        imu=index == size - 1 or chance.random() < 0.2,
        reference_rad=chance.uniform(-0.1, 0.1),
        initial_rad=chance.uniform(-0.3, 0.3),
        lumped_delay_ticks=size - 1 + chance.randint(0, 6),
        unattended=UnattendedJoint(chance.choice(("limp", "braked", "passive")), 100.0, 5.0),
    )


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
