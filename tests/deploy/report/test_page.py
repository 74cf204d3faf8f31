import re
from dataclasses import replace

import pytest

from deploy.report.page import SVG_BYTES_MAX, Block, Figure, Image, Page, PageTable, Remark, Section

NASTY = "<script>alert('x')</script> & \"co\" ${oops}"
IMAGE = Image("picture", "", b"<svg/>", b"pixels")
TABLE = PageTable("Numbers", "Read it so.", ["name", "value"], [["one", "1"], ["two", "2"]])


def page(*blocks: Figure | PageTable | Remark, title: str = "Run") -> str:
    return Page(title, "About it.", [Section("part", "Part", blocks)]).html()


def test_names_are_escaped_wherever_they_stand() -> None:
    image = replace(IMAGE, label=NASTY)
    table = PageTable(NASTY, NASTY, [NASTY, NASTY], [[NASTY, NASTY]], notes=[(NASTY, NASTY)])
    blocks: list[Block] = [Figure(NASTY, NASTY, [image, image]), table, replace(table, folded=True)]
    written = Page(
        NASTY, NASTY, [Section(NASTY, NASTY, [*blocks, Remark(NASTY)])], [NASTY], NASTY
    ).html()
    assert "<script" not in written
    assert '"co"' not in written
    assert "${oops}" in written


def test_the_page_needs_nothing_but_itself() -> None:
    written = page(Figure("A", "So.", [IMAGE]), TABLE, Remark("Nothing."))
    assert "http:" not in written
    assert "https:" not in written
    assert "url(" not in written
    assert "@import" not in written
    loaded = re.findall(r"(?:src|href)\s*=\s*[\"']?([^\"'\s>]+)", written)
    assert loaded
    assert all(address.startswith(("data:", "#")) for address in loaded)


def test_a_figure_or_table_without_a_sentence_is_refused() -> None:
    for block in (Figure("A", " ", [IMAGE]), replace(TABLE, reading="")):
        with pytest.raises(AssertionError, match="how is it read"):
            page(block)


def test_a_row_has_a_cell_for_each_column() -> None:
    with pytest.raises(AssertionError, match="Numbers"):
        page(replace(TABLE, rows=[["one"]]))


def test_a_name_that_repeats_is_written_once() -> None:
    rows = [["run", "1"], ["run", "2"], ["other", "3"], ["run", "4"]]
    written = page(replace(TABLE, rows=rows))
    assert written.count(">run<") == 2
    assert written.count(">other<") == 1


def test_numbers_that_repeat_are_all_written() -> None:
    table = PageTable("Times", "So.", ["s", "what"], [["1", "a"], ["1", "b"]], texts=frozenset({1}))
    assert page(table).count('<td class="n">1</td>') == 2


@pytest.mark.parametrize(
    ("svg", "png", "kind"),
    [
        (10, 1, "svg+xml"),
        (SVG_BYTES_MAX, 1, "svg+xml"),
        (SVG_BYTES_MAX + 1, 1, "png"),
        (SVG_BYTES_MAX + 1, SVG_BYTES_MAX + 1, "svg+xml"),
    ],
)
def test_a_large_drawing_goes_in_as_pixels_where_they_are_fewer(
    svg: int, png: int, kind: str
) -> None:
    written = page(Figure("A", "So.", [Image("a", "", b"s" * svg, b"p" * png)]))
    assert f"data:image/{kind};base64," in written


def test_small_figures_and_tables_stand_side_by_side_and_wide_ones_alone() -> None:
    small, wide = Figure("S", "So.", [IMAGE]), Figure("W", "So.", [IMAGE], wide=True)
    written = page(small, small, wide, TABLE, TABLE, small)
    order = re.findall(r'class="(beside|wide|tables)"', written)
    assert order == ["beside", "wide", "tables", "beside"]
