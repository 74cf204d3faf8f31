"""What documents say of the code is made from it: every marked region is as the code has it now."""

import re
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

import pytest

from deploy.generated.markdown import attribute_docs, table
from deploy.generated.regions import ROOT, TABLES, documents, renewed


@pytest.mark.parametrize("path", documents(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_regions_are_up_to_date(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert renewed(text) == text, "make docs"


@pytest.mark.parametrize("path", documents(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_mark_has_its_end(path: Path) -> None:
    marks = re.findall(r"<!-- (generated: [^ ]+|end) -->", path.read_text(encoding="utf-8"))
    assert [mark == "end" for mark in marks] == [False, True] * (len(marks) // 2)


def test_every_table_is_in_a_document() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in documents())
    used = re.findall(r"<!-- generated: ([^ ]+) -->", text)
    assert sorted(used) == sorted(TABLES)


def test_a_region_is_replaced_and_nothing_else() -> None:
    text = "before\n<!-- generated: one -->\nold\nlines\n<!-- end -->\nafter\n"
    new = renewed(text, {"one": lambda: "new"})
    assert new == "before\n<!-- generated: one -->\nnew\n<!-- end -->\nafter\n"
    with pytest.raises(KeyError):
        renewed(text, {})


def test_a_cell_is_one_line_without_bars() -> None:
    assert table(("a", "b"), [(1, "x\n | y")]) == "| a | b |\n| --- | --- |\n| 1 | x \\| y |"


class _Below(IntEnum):
    ONE = 1
    """The
    first."""
    TWO = 2


class _Fields(NamedTuple):
    first: int
    """Of them."""


def test_docstrings_of_attributes_are_read_from_the_source(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.generated.markdown.OURS", {__name__.partition(".")[0]})
    assert attribute_docs(_Below) == {"ONE": "The first."}
    assert attribute_docs(_Fields) == {"first": "Of them."}
