"""The hunt itself: some seeds in every test run, and proof that its checker can fail."""

from collections.abc import Callable

import pytest

from module_agent.firmware.board import Actuation, Board
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Candidate, Round, Vote
from module_agent.firmware.hearing import Hearing
from plant_server.session.plant import Plant
from protocol.wire.frames import LinkFrame, Neighbour, Observation, TorqueFrame, decode, encode
from tests.sim.hunt import find
from tests.sim.plans import plan

pytestmark = pytest.mark.sampling

SEEDS = 48
CAUGHT_WITHIN = 60


@pytest.mark.parametrize("seed", range(SEEDS))
def test_safety_while_everything_goes_wrong_and_liveness_once_it_is_healed(seed: int) -> None:
    """A failure is replayed by `python -m tests.sim --seed N`."""
    assert find(seed).broken == ""


def test_a_seed_replays_to_the_same_bytes() -> None:
    """S19: everything recorded, faults and deaths and all."""
    assert find(3) == find(3)
    assert find(3).digest != find(4).digest


def test_plans_differ_in_kind() -> None:
    """Bodies of 1 to 6 boards, both policies, and rates of nothing and of much."""
    plans = [plan(seed) for seed in range(100)]
    assert {len(one.scenario.joints) for one in plans} == {1, 2, 3, 4, 5, 6}
    policies = {one.scenario.election.incomplete for one in plans}
    assert policies == {"each-side", "keep-last"}
    assert {one.rates.death > 0.0 for one in plans} == {False, True}


def _everybody() -> Callable[..., Vote]:
    vote = MaxConsensus.vote

    def sabotaged(self: MaxConsensus, now: Round) -> Vote:
        return vote(self, now)._replace(enabled=True)

    return sabotaged


def _late_answer(frame: TorqueFrame) -> TorqueFrame:
    return frame._replace(epoch=frame.epoch - 1) if frame.epoch > 0 else frame


def _answer_with(change: Callable[[TorqueFrame], TorqueFrame]) -> Callable[..., Actuation]:
    tick = Board.tick

    def sabotaged(self: Board, observation: Observation) -> Actuation:
        actuation = tick(self, observation)
        return actuation._replace(torque=encode(change(decode(TorqueFrame, actuation.torque))))

    return sabotaged


def _hears_anybody() -> Callable[..., list[LinkFrame]]:
    """S5 forgotten: whatever was said is used, by whichever incarnation."""
    take = Hearing.take

    def sabotaged(self: Hearing, tick: int, neighbour: Neighbour) -> list[LinkFrame]:
        for said_tick, incarnation in self._waiting:
            if said_tick == tick - 1:
                neighbour = Neighbour(incarnation, said_tick, 1)
        return take(self, tick, neighbour)

    return sabotaged


def _made_up() -> Callable[..., Vote]:
    """An urgency that nobody claims."""
    vote = MaxConsensus.vote

    def sabotaged(self: MaxConsensus, now: Round) -> Vote:
        cast = vote(self, now)
        if now.number == 0:
            self.best = Candidate(9.0, (self.board + 1) % 2)
        return cast._replace(best=self.best)

    return sabotaged


def _keeps_no_incarnation() -> Callable[..., None]:
    """S2 forgotten: who comes back is not told from who was there."""
    admit = Plant.admit

    def sabotaged(self: Plant, board: int, _incarnation: int) -> None:
        admit(self, board, 1)

    return sabotaged


@pytest.mark.parametrize(
    ("owner", "name", "sabotaged", "law"),
    [
        (MaxConsensus, "vote", _everybody(), "S13"),
        (MaxConsensus, "vote", _made_up(), "S11"),
        (Board, "tick", _answer_with(_late_answer), "S11"),
        (Board, "tick", _answer_with(lambda f: f._replace(torque_nm=float("nan"))), "S17"),
        (
            Board,
            "tick",
            _answer_with(lambda f: f._replace(tick=f.tick + 1)),
            "every board has answered",
        ),
        (Hearing, "take", _hears_anybody(), "S"),
        (Hearing, "has", lambda *_: False, "S6"),
        (Plant, "admit", _keeps_no_incarnation(), ""),
    ],
    ids=[
        "all-elected",
        "made-up",
        "old-epoch",
        "nan",
        "wrong-tick",
        "anybody",
        "waits",
        "incarnation",
    ],
)
def test_the_checker_catches_sabotage(
    monkeypatch: pytest.MonkeyPatch, owner: type, name: str, sabotaged: object, law: str
) -> None:
    monkeypatch.setattr(owner, name, sabotaged)
    all_found = (find(seed) for seed in range(CAUGHT_WITHIN))
    broken = next(found.broken for found in all_found if found.broken)
    assert law in broken
