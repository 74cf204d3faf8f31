"""README is short and leads everywhere: to every chapter, and into every folder."""

import re
from pathlib import Path

from tests.docs.documents import CHAPTERS, ROOT, section, text_of

README = ROOT / "README.md"
LINES_MAX = 200
PACKAGES = ("protocol", "module_agent", "plant_server", "deploy")
HIDDEN = {"decmesh"}
"""A folder that readers need not know: the command under its own name."""


def test_the_readme_is_short() -> None:
    assert len(text_of(README).splitlines()) <= LINES_MAX


def test_the_readme_leads_to_every_chapter() -> None:
    linked = set(re.findall(r"\]\(deploy/docs/([\w-]+\.md)\)", text_of(README)))
    assert linked == {path.name for path in CHAPTERS.glob("*.md")}


def test_the_readme_names_every_folder() -> None:
    tree = section(README, "Where things are")
    shown = re.findall(r"^ *([a-z_]+)/ ", tree, re.MULTILINE)
    folders = [one for package in PACKAGES for one in (package, *subfolders(ROOT / package))]
    assert set(folders) - HIDDEN <= set(shown)


def subfolders(package: Path) -> list[str]:
    return [path.name for path in package.iterdir() if path.is_dir() and path.name[0] != "_"]
