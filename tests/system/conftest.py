"""Starts real processes, and makes sure that none outlives its test."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from deploy.launch import rigs
from deploy.scenario_file.load import load
from tests.system.rig import Rig


@pytest.fixture
def make_rig(tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    """Make rigs on ports that nobody uses, and end all of their processes afterwards."""
    with contextlib.ExitStack() as claims:
        made: list[Rig] = []

        def make(*settings: str, source: str = "paper") -> Rig:
            folder = tmp_path / f"rig{len(made)}"
            folder.mkdir()
            placed = claims.enter_context(rigs.claim(load(source, list(settings)), folder))
            made.append(Rig(folder, placed))
            return made[-1]

        yield make
        for process in (process for rig in made for process in rig.processes):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
