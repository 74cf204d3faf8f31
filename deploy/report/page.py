"""The page of a report: sections of figures and tables as one HTML file that needs nothing else.

Rule 1: every name and number is escaped by the template; nothing is trusted to be harmless.
Rule 2: every figure and table has a sentence that says how to read it.
Rule 3: nothing is loaded: the style is in the page, pictures are `data:` addresses, no script.
"""

import base64
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import groupby

from jinja2 import Environment, StrictUndefined

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

    @property
    def source(self) -> str:
        """Itself as an address, drawn or as pixels."""
        drawn = len(self.svg) <= max(SVG_BYTES_MAX, len(self.png))
        kind, content = ("svg+xml", self.svg) if drawn else ("png", self.png)
        return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


@dataclass(frozen=True, slots=True)
class Figure:
    """Pictures of the same thing, one for each run."""

    title: str
    reading: str
    images: Sequence[Image]
    wide: bool = False
    """As wide as the page; else two stand beside each other."""

    @property
    def beside(self) -> str:
        """With what it may stand side by side."""
        return "" if self.wide or len(self.images) > 1 else "beside"


@dataclass(frozen=True, slots=True)
class PageTable:
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

    @property
    def beside(self) -> str:
        """With what it may stand side by side."""
        return "" if self.folded else "tables"

    def cell_kind(self, column: int, text: str) -> str:
        """How the text of a cell is set."""
        if column not in self.texts:
            return "n"
        return "short" if len(text) <= SHORT_MAX else "long"

    @property
    def written_rows(self) -> Iterator[tuple[bool, list[str]]]:
        """Rows as they are written: a name that is the same as in the row above stands once."""
        above = None
        for row in self.rows:
            again = 0 in self.texts and row[0] == above
            above = row[0]
            yield again, ["" if again else row[0], *row[1:]]


@dataclass(frozen=True, slots=True)
class Remark:
    """A line of text, such as why something is not here."""

    text: str
    beside = ""


Block = Figure | PageTable | Remark


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what is below it."""

    anchor: str
    title: str
    blocks: Sequence[Block]

    @property
    def flow(self) -> Iterator[tuple[str, list[Block]]]:
        """Blocks that stand side by side, as they follow each other."""
        for kind, group in groupby(self.blocks, lambda block: block.beside):
            yield kind, list(group)


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
        for section in self.sections:
            for block in section.blocks:
                _check(block)
        text = files("deploy.report").joinpath("page.html").read_text("utf-8")
        made = Environment(
            autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
        )
        made.tests["figure"] = lambda block: isinstance(block, Figure)
        made.tests["table"] = lambda block: isinstance(block, PageTable)
        return made.from_string(text).render(page=self)


def _check(block: Block) -> None:
    if isinstance(block, Remark):
        return
    assert block.reading.strip(), f"{block.title}: how is it read?"
    if isinstance(block, PageTable):
        assert all(len(row) == len(block.header) for row in block.rows), block.title
