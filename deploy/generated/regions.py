"""Marked regions of a document, and what stands in them.

    <!-- generated: exit-codes -->
    ... replaced by what `TABLES["exit-codes"]` gives ...
    <!-- end -->

To add one: a function without arguments that gives Markdown, an entry in `TABLES`, and the two
marks where it is wanted; then `make docs`. A test holds every region of every document.
"""

import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from deploy.generated.channels import channels
from deploy.generated.commands import commands, options
from deploy.generated.exit_codes import exit_codes
from deploy.generated.scenario_keys import scenario_keys
from deploy.generated.scenarios import scenarios
from deploy.generated.summary_keys import summary_keys
from deploy.generated.wire import message_tables

ROOT = Path(__file__).parents[2]
TABLES: dict[str, Callable[[], str]] = {
    "channels": channels,
    "commands": commands,
    "exit-codes": exit_codes,
    "options-live": partial(options, "On a running robot"),
    "options-measure": partial(options, "Measure"),
    "options-recordings": partial(options, "Recordings"),
    "options-run": partial(options, "Run"),
    "options-scenarios": partial(options, "Scenarios"),
    "scenario-keys": scenario_keys,
    "scenarios": scenarios,
    "summary-keys": summary_keys,
    **message_tables(),
}
REGION = re.compile(
    r"^<!-- generated: (?P<name>[a-z0-9-]+) -->\n.*?^<!-- end -->$", re.MULTILINE | re.DOTALL
)


def documents() -> list[Path]:
    """Every document that may have regions."""
    below = [path for place in ("protocol", "deploy/docs") for path in (ROOT / place).glob("*.md")]
    return [ROOT / "README.md", *sorted(below)]


def renewed(text: str, tables: Mapping[str, Callable[[], str]] = TABLES) -> str:
    """Give a document with every region made anew. Raises `KeyError` for an unknown name."""

    def region(found: re.Match[str]) -> str:
        name = found["name"]
        return f"<!-- generated: {name} -->\n{tables[name]()}\n<!-- end -->"

    return REGION.sub(region, text)
