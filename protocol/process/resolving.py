"""Resolving: from what a process was started with to its scenario.

A board has no libraries to check a TOML file; it has `deploy` do so, in a process of its own.
"""

import subprocess
import sys
from pathlib import Path

from protocol.robot.scenario import Scenario, ScenarioError, decode


def load(source: str, overrides: list[str]) -> Scenario:
    """Read a resolved scenario (`.json`), or have `deploy` check and resolve any other.

    Raises `ScenarioError` with every complaint about the file, one a line.
    """
    if source.endswith(".json"):
        try:
            return decode(Path(source).read_bytes())
        except (OSError, ScenarioError) as error:
            raise ScenarioError(
                f"{source}: no resolved scenario of this version: {error}"
            ) from error
    settings = [word for override in overrides for word in ("--set", override)]
    command = [sys.executable, "-m", "deploy", "check", source, "--resolved", *settings]
    check = subprocess.run(command, capture_output=True, text=True, check=False)
    if check.returncode != 0:
        raise ScenarioError(check.stderr.strip() or f"{source}: cannot be resolved")
    return decode(check.stdout.encode())
