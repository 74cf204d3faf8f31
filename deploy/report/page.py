"""The page of a report: sections of figures and tables as one HTML file that needs nothing else.

Rule 1: every name and number is escaped; nothing here is trusted to be harmless.
Rule 2: every figure and table has a sentence that says how to read it.
Rule 3: nothing is loaded: the style is in the page, pictures are `data:` addresses, no script.
"""

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from itertools import groupby
from string import Template

SVG_BYTES_MAX = 300_000
"""A drawing that is larger goes into the page as pixels, where those are smaller."""
SHORT_MAX = 24
"""A text of at most so many letters is not broken into lines."""


@dataclass(slots=True)
class Image:
    """One picture, drawn and as pixels; both are empty until it is drawn."""

    name: str
    """Of its files, without an ending."""
    label: str
    """Which run it shows; empty where there is only one."""
    svg: bytes = b""
    png: bytes = b""


@dataclass(frozen=True, slots=True)
class Figure:
    """Pictures of the same thing, one for each run."""

    title: str
    reading: str
    images: Sequence[Image]
    wide: bool = False
    """As wide as the page; else two stand beside each other."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells; the first column names the row."""

    title: str
    reading: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[tuple[str, str]] = ()
    """Marks and what they mean."""
    texts: frozenset[int] = frozenset({0})
    """Columns that hold text, and not numbers."""
    folded: bool = False
    """Shown when asked for."""


@dataclass(frozen=True, slots=True)
class Remark:
    """A line of text, such as why something is not here."""

    text: str


Block = Figure | Table | Remark
_AGAIN = ' class="again"'


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what is below it."""

    anchor: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, slots=True)
class Page:
    """The whole report."""

    title: str
    subtitle: str
    sections: Sequence[Section]
    warnings: Sequence[str] = field(default=())
    footer: str = ""

    def html(self) -> str:
        """Write it."""
        template = Template(files("deploy.report").joinpath("page.html").read_text("utf-8"))
        return template.substitute(
            title=escape(self.title),
            subtitle=escape(self.subtitle),
            warnings="\n".join(
                f'<p class="warning" role="alert">{escape(text)}</p>' for text in self.warnings
            ),
            contents="\n".join(
                f'<li><a href="#{escape(section.anchor)}">{escape(section.title)}</a></li>'
                for section in self.sections
            ),
            sections="\n".join(map(_section, self.sections)),
            footer=escape(self.footer),
        )


def _section(section: Section) -> str:
    anchor, title = escape(section.anchor), escape(section.title)
    body = "\n".join(_flow(section.blocks))
    return f'<section id="{anchor}">\n<h2>{title}</h2>\n{body}\n</section>'


def _flow(blocks: Sequence[Block]) -> Iterator[str]:
    """Write blocks; small figures that follow each other stand side by side, and so do tables."""
    for kind, group in groupby(blocks, _kind):
        written = "\n".join(map(_block, group))
        yield f'<div class="{kind}">\n{written}\n</div>' if kind else written


def _kind(block: Block) -> str:
    match block:
        case Figure(wide=False, images=[_]):
            return "beside"
        case Table(folded=False):
            return "tables"
        case _:
            return ""


def _block(block: Block) -> str:
    match block:
        case Figure():
            return _figure(block)
        case Table():
            return _table(block)
        case Remark(text):
            return f'<p class="remark">{escape(text)}</p>'


def _figure(figure: Figure) -> str:
    kind = "wide" if figure.wide else "small"
    pictures = "\n".join(_picture(figure, image) for image in figure.images)
    caption = _caption("figcaption", figure.title, figure.reading)
    return (
        f'<figure class="{kind}">\n<div class="pictures">\n{pictures}\n</div>\n{caption}\n</figure>'
    )


def _picture(figure: Figure, image: Image) -> str:
    label = f'<p class="run">{escape(image.label)}</p>\n' if image.label else ""
    alt = escape(f"{figure.title}: {image.label}" if image.label else figure.title)
    drawn = len(image.svg) <= max(SVG_BYTES_MAX, len(image.png))
    kind, content = ("svg+xml", image.svg) if drawn else ("png", image.png)
    source = f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
    scroll = f'class="scroll" tabindex="0" role="region" aria-label="{alt}"'
    return f'<div class="picture">{label}<div {scroll}><img src="{source}" alt="{alt}"></div></div>'


def _table(table: Table) -> str:
    assert all(len(row) == len(table.header) for row in table.rows), table.title
    head = "".join(_cell("th", i, cell, table) for i, cell in enumerate(table.header))
    rows = "\n".join(_rows(table))
    notes = "".join(
        f"<dt>{escape(mark)}</dt><dd>{escape(meaning)}</dd>" for mark, meaning in table.notes
    )
    name = escape(table.title)
    text = (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{name}">'
        f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table></div>"
        + (f'<dl class="notes">{notes}</dl>' if notes else "")
    )
    caption = _caption("p", table.title, table.reading)
    if table.folded:
        return f'<details class="table"><summary>{name}</summary>\n{caption}\n{text}</details>'
    return f'<div class="table">{caption}\n{text}</div>'


def _rows(table: Table) -> Iterator[str]:
    """Write rows; a name that is the same as in the row above is not written again."""
    above = None
    for row in table.rows:
        again = 0 in table.texts and row[0] == above
        above = row[0]
        written = ["" if again else row[0], *row[1:]]
        cells = "".join(_cell("td", i, cell, table) for i, cell in enumerate(written))
        yield f"<tr{_AGAIN * again}>{cells}</tr>"


def _cell(tag: str, column: int, text: str, table: Table) -> str:
    kind = "n" if column not in table.texts else "short" if len(text) <= SHORT_MAX else "long"
    return f'<{tag} class="{kind}">{escape(text)}</{tag}>'


def _caption(tag: str, title: str, reading: str) -> str:
    assert reading.strip(), f"{title}: how is it read?"
    return f'<{tag} class="reading"><b>{escape(title)}.</b> {escape(reading)}</{tag}>'
