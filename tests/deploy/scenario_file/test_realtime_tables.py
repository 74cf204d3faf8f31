"""Realtime mode in a scenario: what is refused, what it becomes; lockstep knows nothing."""

import pytest

from deploy.scenario_file.load import load
from protocol.robot.cadence import Cadence, cadence_of
from protocol.robot.scenario import ScenarioError

REALTIME = "run.mode=realtime"


def test_a_scenario_of_lockstep_has_nothing_of_it() -> None:
    """So its digest, and every frame of it, is what it was before there was another mode."""
    plain = load("paper")
    assert load("paper", ["realtime.rate_hz=100", "board.0.rate_hz=250"]).digest == plain.digest
    assert cadence_of(plain) is None
    assert plain.run.pace is None


def test_rates_become_whole_ticks() -> None:
    found = cadence_of(load("paper", [REALTIME, "board.2.rate_hz=250"]))
    assert found == Cadence(
        ticks_per_period=(2, 2, 4),
        ticks_per_round=8,
        settle_ticks=500,
        ahead_ticks_max=250,
        age_ticks_max=50,
        catches_up=False,
    )
    fine = [REALTIME, "run.tick_ms=0.5", "realtime.missed=catch-up"]
    fast = cadence_of(load("paper", fine))
    assert fast is not None
    assert fast.ticks_per_period == (4, 4, 4)
    assert fast.catches_up


def test_a_pace_is_kept() -> None:
    assert load("paper", ["run.pace=0.25"]).run.pace == 0.25


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        (["realtime.rate_hz=300"], "realtime.rate_hz: a period of 3.333 ms at 300 Hz is not"),
        (["realtime.rate_hz=2000"], "realtime.rate_hz: a period of 0.5 ms at 2000 Hz is not"),
        (["board.1.rate_hz=300"], "board.1.rate_hz: a period of 3.333 ms at 300 Hz is not"),
        (["board.1.rate_hz=-1"], "board.1.rate_hz: input should be greater than 0"),
        (["board.1.rate_hz=20"], "realtime.age_max_ms: 50 ms is less than 2 periods"),
        (["board.1.rate_hz=50"], "election.rounds: in realtime a round takes 40 ms, two periods"),
        (["election.rounds=25"], "election.rounds: in realtime a round takes 4 ms"),
        (["realtime.missed=maybe"], "realtime.missed: input should be 'skip' or 'catch-up'"),
        (["realtime.rat_hz=5"], "realtime.rat_hz: unknown key; did you mean 'rate_hz'?"),
        (["run.pace=1"], "run.pace: realtime goes at the pace of the wall clock; leave it out"),
    ],
)
def test_what_does_not_go_together_is_refused(settings: list[str], complaint: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load("paper", [REALTIME, *settings])
    assert complaint in str(refused.value)


def test_all_complaints_come_at_once() -> None:
    with pytest.raises(ScenarioError) as refused:
        load("paper", [REALTIME, "board.0.rate_hz=300", "board.2.rate_hz=700", "run.pace=2"])
    assert len(str(refused.value).splitlines()) == 3


def test_in_lockstep_rates_are_not_looked_at() -> None:
    assert load("paper", ["realtime.rate_hz=300"]) == load("paper")
