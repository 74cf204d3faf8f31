"""The chapters keep up: links lead somewhere, examples work, what is typed can be typed."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

from deploy.cli import app
from deploy.launch.twin import run_twin
from deploy.scenario_file.load import load
from tests.docs.documents import CHAPTERS, DOCUMENTS, FENCE, ROOT, blocks, text_of

GLOSSARY_WORDS_MAX = 30


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def anchors(path: Path) -> set[str]:
    """Names of a document's headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", text_of(path), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def commands_in(text: str) -> list[str]:
    """Everything that begins with `decmesh`, in blocks and between backticks."""
    shown = [line for block in FENCE.finditer(text) for line in block["text"].splitlines()]
    shown += re.findall(r"`([^`]+)`", FENCE.sub("", text))
    return [line for line in shown if re.match(r"(\.venv/bin/)?decmesh ", line)]


def test_the_glossary_is_short_and_in_order() -> None:
    words = re.findall(r"^\| ([^|]+) \|", text_of(CHAPTERS / "glossary.md"), re.MULTILINE)[1:]
    assert len(words) <= GLOSSARY_WORDS_MAX
    assert words == sorted(words, key=str.lower)
    assert f"| {len(words)} words. |" in text_of(ROOT / "README.md")


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_every_link_leads_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", text_of(path)):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        there = (path.parent / file).resolve() if file else path
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_commands_can_be_typed(path: Path) -> None:
    root: Any = typer.main.get_command(app)
    for line in commands_in(text_of(path)):
        words = shlex.split(re.split(r" [>|&]|&&", line)[0], comments=True)[1:]
        if any(word.isupper() or word == "--help" for word in words):
            continue  # With words that stand for others.
        command = root
        while words and hasattr(command, "commands"):
            command = command.commands[words.pop(0)]
        if words:
            command.make_context(line, words)


def test_settings_can_be_set() -> None:
    settings = {
        setting
        for path in DOCUMENTS
        for setting in re.findall(r"--set\s+([a-z][\w.]*=[\w.:]+)", text_of(path))
    }
    assert len(settings) > 8
    load("paper", sorted(settings))


def test_the_scenarios_by_example_can_be_run_and_the_pole_stands(tmp_path: Path) -> None:
    pole, faults = (one.text for one in blocks(CHAPTERS / "scenarios.md") if one.kind == "toml")
    path = tmp_path / "example.toml"
    path.write_text(faults, encoding="utf-8")
    load(str(path))
    path.write_text(pole, encoding="utf-8")
    _, outcome = run_twin(load(str(path)))
    assert outcome.ending == "complete"
    assert abs(outcome.angles_rad[0]) < 0.01


def test_the_controllers_by_example_are_those_that_come_along(tmp_path: Path) -> None:
    """Word for word, but for what a module says first; and the lines that choose them are valid."""
    found = blocks(CHAPTERS / "own-controllers.md")
    shown = [block.text for block in found if block.kind == "python"]
    for code, file in zip(shown, ("hysteresis", "computed_torque"), strict=True):
        source = text_of(ROOT / f"deploy/scenarios/{file}.py")
        _, _, after_docstring = source.split('"""', 2)
        assert code == after_docstring.lstrip()
        assert len(code.splitlines()) <= 30
    (chosen,) = (block.text for block in found if block.kind == "toml")
    path = tmp_path / "example.toml"
    path.write_text(f'extends = "paper"\n{chosen}', encoding="utf-8")
    scenario = load(str(path))
    assert scenario.election.rule is not None
    assert scenario.election.rule.reference == "hysteresis:Hysteresis"
    servos = [board.controller and board.controller.reference for board in scenario.boards]
    assert servos == ["computed_torque:ComputedTorque"] * 3
