"""README keeps up: what it must name, it names."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import typer
from pydantic import BaseModel

from deploy.cli import app
from deploy.launch.twin import run_twin
from deploy.outcome.summary import summary
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import available, load
from deploy.scenario_file.tables import Scenario
from protocol.process.exit_codes import ExitCode

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    """The text below a heading, up to the next one of the same level."""
    found = re.search(
        rf"^(#+) {re.escape(title)}\n(.*?)(?=^\1 |\Z)", README, re.MULTILINE | re.DOTALL
    )
    assert found, title
    return found.group(2)


def keys(kind: Any) -> Iterator[str]:
    """Every key that a table may have, with those of the tables in it."""
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
        for inner in get_args(kind):
            yield from keys(inner)
        return
    for name, field in kind.model_fields.items():
        inner_keys = list(keys(field.annotation))
        yield from inner_keys or [name]


def leaves(values: dict[str, Any]) -> Iterator[str]:
    for key, value in values.items():
        yield key
        if isinstance(value, dict) and key in {"indices", "energy_j", "consensus", "TS"}:
            yield from leaves(value)


def test_every_key_of_a_scenario_is_explained() -> None:
    told = set(re.findall(r"`([a-z0-9_]+)`", section("A scenario of your own")))
    assert set(keys(Scenario)) <= told


def test_every_key_of_a_summary_is_explained() -> None:
    scenario = load("paper", ["run.duration_s=0.2"])
    found = summary(trajectory(scenario.values, *run_twin(scenario)), mode="twin")
    told = set(re.findall(r"`([A-Za-z0-9_]+)`", section("summary.json") + section("Table II")))
    assert set(leaves(found)) - {"TS", "KNEE", "BS"} <= told


def test_every_exit_code_is_listed() -> None:
    listed = {int(code) for code in re.findall(r"^\| (\d+) ", section("Exit codes"), re.MULTILINE)}
    assert set(map(int, ExitCode)) <= listed


def commands(group: typer.Typer, prefix: str) -> Iterator[str]:
    """Every command, those in groups included, as it is typed."""
    for command in group.registered_commands:
        assert command.callback is not None
        yield f"{prefix} {command.name or command.callback.__name__}"
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        yield from commands(inner.typer_instance, f"{prefix} {inner.name}")


def test_every_command_is_listed() -> None:
    found = list(commands(app, "decmesh"))
    assert "decmesh study loss" in found
    assert [command for command in found if f"`{command}" not in README] == []


def test_every_scenario_is_listed() -> None:
    listed = re.findall(r"^\| `([a-z-]+)` ", section("Scenarios"), re.MULTILINE)
    assert sorted(listed) == available()


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_every_link_leads_somewhere(target: str) -> None:
    assert (ROOT / target).exists()


def test_the_scenarios_by_example_can_be_run_and_the_pole_stands(tmp_path: Path) -> None:
    own = section("A scenario of your own")
    pole, faults = re.findall(r"```toml\n(.*?)```", own, re.DOTALL)
    path = tmp_path / "example.toml"
    path.write_text(f'extends = "paper"\n{faults}', encoding="utf-8")
    load(str(path))
    path.write_text(pole, encoding="utf-8")
    _, outcome = run_twin(load(str(path)))
    assert outcome.ending == "complete"
    assert abs(outcome.angles_rad[0]) < 0.01


def test_settings_in_the_readme_can_be_set() -> None:
    settings = re.findall(r"--set ([\w.]+=[\w.:]+)", README)
    assert len(settings) > 5
    assert load("paper", settings).values["rig"]["base_port"] == 18_000
    assert "paper" in available()


def test_the_controllers_by_example_are_those_that_come_along(tmp_path: Path) -> None:
    """Word for word, but for what a module says first; and the lines that choose them are valid."""
    own = section("Your own controller")
    shown = re.findall(r"```python\n(.*?)```", own, re.DOTALL)
    for code, name in zip(shown, ("hysteresis", "computed_torque"), strict=True):
        source = (ROOT / f"deploy/scenarios/{name}.py").read_text(encoding="utf-8")
        _, _, after_docstring = source.split('"""', 2)
        assert code == after_docstring.lstrip()
        assert len(code.splitlines()) <= 30
    (chosen,) = re.findall(r"```toml\n(.*?)```", own, re.DOTALL)
    path = tmp_path / "example.toml"
    path.write_text(f'extends = "paper"\n{chosen}', encoding="utf-8")
    values = load(str(path)).values
    assert values["election"]["rule"]["class"] == "hysteresis:Hysteresis"
    assert [board["controller"]["class"] for board in values["board"]] == [
        "computed_torque:ComputedTorque"
    ] * 3
