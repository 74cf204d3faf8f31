"""What is written down, read back, compared and shown."""

from pathlib import Path
from typing import Any

import pytest

from tests.bench.compare import compare
from tests.bench.plot import picture
from tests.bench.results import Entry, GroupResult, Related, Results
from tests.bench.table import comparison_table, footnotes, markdown, rows

MACHINE: dict[str, Any] = {
    "when": "now", "commit": "abc", "processor": "some", "cores": 2, "system": "Linux",
    "python": "3", "control_loop": "interpreted", "versions": {"numpy": "2"},
}  # fmt: skip


def results(*, machine: dict[str, Any] | None = None, **entries: list[float]) -> Results:
    """One group; names of figures come with the values, as in `ticks_per_s=[...]`."""
    group = GroupResult("some title", load=[0.5, 1.0], seconds=3.0)
    for figure, values in entries.items():
        repeats = {n: {figure: value} for n, value in enumerate(values)}
        group.entries[f"one in {figure}"] = Entry(repeats)
    group.ratios["ours of theirs"] = Related("ticks_per_s", [0.5, 0.6])
    group.missing["dora-rs"] = "it is not installed"
    return Results({**MACHINE, **(machine or {})}, {"repeats": 2}, {"group": group})


def verdicts(then: Results, now: Results) -> dict[str, str]:
    return {change.name: change.verdict for change in compare(then, now)}


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "bench.json"
    before = results(ticks_per_s=[1.0, 2.0], seconds=[0.25, 0.5])
    before.write(path)
    assert Results.read(path) == before


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 0}', '{"format": 1, "groups": 3}'])
def test_what_is_no_result_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.json is no result"):
        Results.read(path)


def test_a_clear_change_is_better_or_worse_by_its_kind() -> None:
    then = results(ticks_per_s=[100.0, 101.0, 102.0], seconds=[1.0, 1.1, 1.2])
    now = results(ticks_per_s=[200.0, 201.0, 202.0], seconds=[2.0, 2.1, 2.2])
    assert verdicts(then, now) == {
        "one in ticks_per_s": "better",
        "one in seconds": "worse",
        "ratio: ours of theirs": "same",
    }
    assert set(verdicts(now, then).values()) == {"better", "worse", "same"}


@pytest.mark.parametrize(
    "now",
    [[150.0, 151.0, 90.0], [103.0, 104.0, 105.0], [150.0, 151.0]],
    ids=["ranges overlap", "a few per cent", "too few repeats"],
)
def test_noise_is_no_change(now: list[float]) -> None:
    then = results(ticks_per_s=[100.0, 101.0, 102.0])
    assert verdicts(then, results(ticks_per_s=now))["one in ticks_per_s"] == "same"


def test_between_machines_only_ratios_are_compared() -> None:
    then = results(ticks_per_s=[100.0], machine={"processor": "another"})
    assert verdicts(then, results(ticks_per_s=[200.0])) == {"ratio: ours of theirs": "same"}


def test_a_ratio_is_better_as_its_figure_is() -> None:
    then, now = results(), results()
    then.groups["group"].ratios = {"growth": Related("us_per_board", [1.0] * 3)}
    now.groups["group"].ratios = {"growth": Related("us_per_board", [2.0] * 3)}
    assert verdicts(then, now) == {"ratio: growth": "worse"}


def test_what_one_of_them_lacks_is_not_compared() -> None:
    assert "one in seconds" not in verdicts(results(), results(seconds=[1.0]))


def test_a_row_has_median_and_range_and_ratios_come_last() -> None:
    group = results(ticks_per_s=[1000.0, 3000.0, 2000.0]).groups["group"]
    assert [row[:4] for row in rows(group)] == [
        ("one in ticks_per_s", "2,000", "1,000", "3,000"),
        ("  ours of theirs", "0.55", "0.50", "0.60"),
    ]


def test_figures_that_have_a_column_stand_in_it_others_below() -> None:
    entry = Entry({0: {"ticks_per_s": 1.0, "p99_us": 7.0, "notice_s": 1e-7}})
    group = GroupResult("title", entries={"name": entry})
    assert list(rows(group)) == [
        ("name", "1", "1", "1", "", "7", ""),
        ("  killed until the plant says so, s", "1.0e-07", "1.0e-07", "1.0e-07", "", "", ""),
    ]


def test_the_markdown_table_is_whole() -> None:
    lines = markdown(results(seconds=[1.0])).splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert "| one in seconds | 1.000 | 1.000 | 1.000 |" in lines[3]


def test_what_is_missing_is_said() -> None:
    assert "without dora-rs: it is not installed" in list(footnotes(results()))


def test_a_comparison_shows_what_changed() -> None:
    changes = compare(results(seconds=[1.0] * 3), results(seconds=[2.0] * 3))
    assert comparison_table(changes).row_count == 1


def test_the_picture_shows_what_there_is(tmp_path: Path) -> None:
    path = tmp_path / "bench.png"
    picture(results(seconds=[1.0]), path)
    assert not path.exists()
    job = Entry({0: {"ticks_per_s": 1.0, "p50_us": 7.0, "p99_us": 9.0}})
    grown = {f"{n} boards": Entry({0: {"us_per_board": 5.0 + n}}) for n in (3, 10)}
    engines = {"decmesh, RK4": Entry({0: {"us_per_tick": 7.0}})}
    groups = {
        "systems": GroupResult("systems", entries={"decmesh": job, "other": job}),
        "growth": GroupResult("in the twin", entries=grown),
        "plant": GroupResult("plant", entries=engines),
    }
    picture(Results(MACHINE, {}, groups), path)
    assert path.stat().st_size > 1000
