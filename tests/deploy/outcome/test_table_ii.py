from copy import deepcopy

import pytest

from deploy.launch.twin import run_twin
from deploy.outcome.summary import Summary, summary
from deploy.outcome.table_ii import (
    ELSEWHERE,
    EXPLANATIONS,
    PAPER,
    meets,
    notes,
    performance_table,
    text,
)
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load


def run(*overrides: str) -> Summary:
    scenario = load("paper", ["run.duration_s=0.5", *overrides])
    return summary(trajectory(scenario, *run_twin(scenario)), mode="twin")


@pytest.fixture(scope="module")
def original() -> Summary:
    return run("election.enabled=false")


@pytest.fixture(scope="module")
def distributed() -> Summary:
    return run()


def as_printed(found: Summary, column: int) -> Summary:
    """The same run with the paper's own numbers."""
    printed = deepcopy(found)
    printed["simulated_s"] = 10.0
    for (name, key), values in PAPER.items():
        (printed["indices"][name] if name else printed["energy_j"])[key] = values[column]
    return printed


def test_it_has_the_rows_and_columns_of_table_2(original: Summary, distributed: Summary) -> None:
    table = performance_table(original, distributed)
    assert [str(column.header).split("\n")[0] for column in table.columns] == [
        "Variable", "Index", "Original", "", "Distributed", "",
    ]  # fmt: skip
    assert [cell for cell in table.columns[0].cells if cell] == ["TS", "KNEE", "BS"]
    printed = text(original, distributed)
    for number in ("2.5118°", "2.1166°", "0.31 s", "9.99 s", "196.72 J", "68.25 J"):
        assert number in printed


def test_the_papers_own_numbers_are_all_met(original: Summary, distributed: Summary) -> None:
    runs = as_printed(original, 0), as_printed(distributed, 1)
    assert [note.mark for note in notes(*runs)] == ["—", "✓"]
    assert text(*runs).count("✓") == 2 * len(PAPER) + 1


def test_each_index_that_is_not_met_has_one_footnote(
    original: Summary, distributed: Summary
) -> None:
    left, right = as_printed(original, 0), as_printed(distributed, 1)
    left["indices"]["BS"]["overshoot_deg"] = 0.4
    right["indices"]["BS"]["overshoot_deg"] = 0.2
    right["indices"]["KNEE"]["rise_s"] = None
    letters = {note.mark: note.text for note in notes(left, right)[2:]}
    assert letters == {"a": EXPLANATIONS["rise_s"], "b": EXPLANATIONS["overshoot_deg"]}
    printed = text(left, right)
    assert "0.4000° b" in printed
    assert "0.2000° b" in printed
    assert "— a" in printed


def test_what_is_not_the_papers_run_is_not_explained_by_it(distributed: Summary) -> None:
    assert notes(None, distributed)[-1].text == ELSEWHERE


def test_one_run_has_its_own_column_only(distributed: Summary) -> None:
    printed = text(None, distributed)
    assert "Distributed" in printed
    assert "Original" not in printed


def test_another_body_is_not_compared(distributed: Summary) -> None:
    other = deepcopy(distributed)
    other["indices"] = {"ELBOW": other["indices"]["KNEE"]}
    printed = text(None, other)
    assert "ELBOW" in printed
    assert "paper" not in printed
    assert "68.25" not in printed


def test_it_tells_of_elections_and_speed(original: Summary, distributed: Summary) -> None:
    printed = text(original, distributed)
    assert "5 epochs; agreed after" in printed
    assert "one board in 5, none in 0" in printed
    assert "Consensus" not in text(original, None)
    assert printed.count("ticks/s") == 2


def test_plain_text_is_plain(original: Summary, distributed: Summary) -> None:
    printed = text(original, distributed)
    assert "\x1b" not in printed
    assert "\u00a0" not in printed
    assert all(line == line.rstrip() for line in printed.splitlines())


@pytest.mark.parametrize(
    ("key", "ours", "paper", "met"),
    [
        ("overshoot_deg", 2.75, 2.5, True),
        ("overshoot_deg", 2.76, 2.5, False),
        ("overshoot_deg", 0.0, 0.0, True),
        ("overshoot_deg", 0.001, 0.0, False),
        ("rise_s", 0.36, 0.31, True),
        ("rise_s", 0.37, 0.31, False),
        ("rise_s", None, 0.31, False),
        ("settling_paper_s", 9.0, 9.99, True),
        ("positive", 75.0, 68.25, True),
        ("positive", 76.0, 68.25, False),
    ],
)
def test_met_is_within_a_tenth_or_five_hundredths_of_a_second(
    key: str, ours: float | None, paper: float, met: bool
) -> None:
    assert meets(key, ours, paper) is met


def test_another_scenario_is_not_compared_with_the_paper(distributed: Summary) -> None:
    printed = text(None, {**distributed, "scenario": "storm"})
    assert "paper" not in printed
    assert "✓" not in printed
