"""README and the chapters, cut into what tests look at: fenced blocks, headings, links."""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
CHAPTERS = ROOT / "deploy" / "docs"
DOCUMENTS = [ROOT / "README.md", *sorted(CHAPTERS.glob("*.md"))]

FENCE = re.compile(r"^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"Save this as\s+`([\w.]+)`:\n\n$")


class Block(NamedTuple):
    """A fenced block of a document."""

    kind: str
    """`bash`, `text`, `toml`, `python`, or "" for what is only shown."""
    text: str
    file: str | None
    """The name under which the reader is asked to save it."""


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def blocks(path: Path) -> list[Block]:
    """Every fenced block of a document, from top to bottom."""
    text = text_of(path)
    found = []
    for fence in FENCE.finditer(text):
        name = FILE_NAME.search(text[: fence.start()])
        found.append(Block(fence["kind"], fence["text"], name and name[1]))
    return found


def section(path: Path, title: str) -> str:
    """The text below a heading, up to the next one of the same level."""
    found = re.search(
        rf"^(#+) {re.escape(title)}\n(.*?)(?=^\1 |\Z)", text_of(path), re.MULTILINE | re.DOTALL
    )
    assert found, title
    return found.group(2)
