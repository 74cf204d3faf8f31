"""The resolved scenario: what every process of a run starts from, and its digest.

A scenario is written as TOML, and checked and completed by `deploy`, which has the libraries for
it. What comes out, plain JSON with every value filled in, is what plant and boards read (S23).
Its digest is part of enrolment, so processes started from different files refuse each other.
"""

import hashlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

KEYS = frozenset({"board", "election", "event", "link", "link_names", "name", "rig", "run"})
"""What every resolved scenario has."""


class ScenarioError(Exception):
    """The scenario cannot be used; the message is what the user should read."""


class ResolvedScenario(NamedTuple):
    """A scenario with every value filled in."""

    values: dict[str, Any]
    digest: bytes

    @property
    def joints(self) -> list[str]:
        """Names of the joints, from the ground up."""
        return [board["joint"] for board in self.values["board"]]


def canonical(values: dict[str, Any]) -> bytes:
    """The one way to write resolved values down; the digest is taken of this."""
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode()


def resolved(values: dict[str, Any]) -> ResolvedScenario:
    """Attach the digest. `rig` says where the robot lives, not what it is, and is left out."""
    meaning = {key: value for key, value in values.items() if key != "rig"}
    return ResolvedScenario(values, hashlib.sha256(canonical(meaning)).digest())


def run_id(digest: bytes) -> int:
    """Name of a run: 32 bits with the highest set, so that it always takes five bytes."""
    return int.from_bytes(digest[:4], "little") | 0x8000_0000


def next_run_id(former: int) -> int:
    """Name of the run that follows when a plant is started again before its boards have gone."""
    return (former + 1) & 0xFFFF_FFFF | 0x8000_0000


def load(source: str, overrides: list[str]) -> ResolvedScenario:
    """Read a resolved scenario (`.json`), or have `deploy` check and resolve any other.

    Raises `ScenarioError` with every complaint about the file, one a line.
    """
    if source.endswith(".json"):
        try:
            values = json.loads(Path(source).read_bytes())
            lacking = sorted(KEYS - set(values))
        except (OSError, TypeError, ValueError) as error:
            raise ScenarioError(f"{source}: {error}") from error
        if lacking:
            raise ScenarioError(
                f"{source}: no resolved scenario of this version; {lacking[0]!r} is missing"
            )
        return resolved(values)
    settings = [word for override in overrides for word in ("--set", override)]
    command = [sys.executable, "-m", "deploy", "check", source, "--resolved", *settings]
    check = subprocess.run(command, capture_output=True, text=True, check=False)
    if check.returncode != 0:
        raise ScenarioError(check.stderr.strip() or f"{source}: cannot be resolved")
    return resolved(json.loads(check.stdout))
