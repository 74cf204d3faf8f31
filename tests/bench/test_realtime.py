"""What the bench takes from a run in realtime."""

from tests.bench.realtime import figures
from tests.bench.registry import KINDS


def _board(p50: float | None, p99: float | None) -> dict[str, dict[str, float | None]]:
    names = ("observation_age_ms", "torque_age_ms", "decision_ms")
    return {name: {"p50": p50, "p99": p99} for name in names}


def test_times_are_those_of_the_board_that_is_worst_off() -> None:
    boards = {"ankle": _board(1.0, 9.0), "knee": _board(2.0, 3.0), "hip": _board(None, None)}
    found = figures({"missed_share": 0.25, "boards": boards})
    assert found["missed_share"] == 0.25
    assert found["decision_ms_p50"] == 2.0
    assert found["decision_ms_p99"] == 9.0
    assert next(iter(found)) == "missed_share", "the first is what the bench shows in its line"
    assert set(found) <= set(KINDS)
