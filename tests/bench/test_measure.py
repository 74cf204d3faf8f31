"""The bench turns its contenders, keeps their repeats together, and leaves out what fails."""

import pytest

from tests.bench.children import ChildFailedError, UnavailableError
from tests.bench.measure import FAILURES_MAX, measure
from tests.bench.registry import Contender, Figures, Group, Ratio
from tests.bench.results import Entry, GroupResult, Related
from tests.bench.spread import Spread, spread


def contender(name: str, values: list[float | Exception], log: list[str]) -> Contender:
    """One that gives, or raises, one value after the other."""
    left = iter(values)

    def play() -> Figures:
        log.append(name)
        value = next(left)
        if isinstance(value, Exception):
            raise value
        return {"ticks_per_s": value}

    return Contender(name, play)


def measured(*contenders: Contender, repeats: int) -> tuple[GroupResult, list[str]]:
    told: list[str] = []
    ratios = [Ratio("B of A", "B", "A", "ticks_per_s")]
    group = Group("group", "title", list(contenders), ratios)
    return measure(group, repeats, told.append), told


def test_contenders_take_turns() -> None:
    log: list[str] = []
    result, _ = measured(
        contender("A", [1.0, 2.0, 4.0], log), contender("B", [3.0, 8.0, 8.0], log), repeats=3
    )
    assert log == ["A", "B"] * 3
    assert result.entries["A"].values("ticks_per_s") == {0: 1.0, 1: 2.0, 2: 4.0}
    assert result.ratios == {"B of A": Related("ticks_per_s", [3.0, 4.0, 2.0])}


def test_what_is_not_here_is_skipped_with_a_line() -> None:
    log: list[str] = []
    missing = UnavailableError("xyz is not installed")
    result, told = measured(
        contender("A", [missing], log), contender("B", [1.0, 1.0], log), repeats=2
    )
    assert log == ["A", "B", "B"]
    assert result.missing == {"A": "xyz is not installed"}
    assert any("skipped, xyz is not installed" in line for line in told)
    assert result.ratios == {}


def test_one_failure_costs_one_repeat_and_ratios_stay_together() -> None:
    log: list[str] = []
    result, _ = measured(
        contender("A", [1.0, ChildFailedError("it fell"), 4.0], log),
        contender("B", [3.0, 8.0, 8.0], log),
        repeats=3,
    )
    assert result.missing == {}
    assert result.ratios == {"B of A": Related("ticks_per_s", [3.0, 2.0])}


def test_what_keeps_failing_is_left_out() -> None:
    log: list[str] = []
    trouble = ChildFailedError("it fell")
    result, _ = measured(
        contender("A", [1.0, *[trouble] * FAILURES_MAX], log),
        contender("B", [1.0] * 5, log),
        repeats=5,
    )
    assert log.count("A") == 1 + FAILURES_MAX
    assert list(result.entries) == ["B"]
    assert result.missing == {"A": "failed: ChildFailedError('it fell')"}


def test_a_spread_is_median_and_range() -> None:
    assert spread([5.0, 1.0, 2.0]) == Spread(2.0, 1.0, 5.0, 3)
    with pytest.raises(ValueError, match="nothing"):
        spread([])


def test_spreads_are_apart_when_no_value_is_within_the_other() -> None:
    assert Spread(2.0, 1.0, 3.0, 3).apart(Spread(5.0, 4.0, 6.0, 3))
    assert Spread(5.0, 4.0, 6.0, 3).apart(Spread(2.0, 1.0, 3.0, 3))
    assert not Spread(2.0, 1.0, 4.5, 3).apart(Spread(5.0, 4.0, 6.0, 3))


def test_a_figure_of_some_repeats_is_summarised_from_those() -> None:
    entry = Entry({0: {"seconds": 1.0, "notice_s": 0.5}, 1: {"seconds": 3.0}})
    assert entry.figures == ["seconds", "notice_s"]
    assert entry.spread("notice_s") == Spread(0.5, 0.5, 0.5, 1)
