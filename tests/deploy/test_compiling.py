"""The control loop in C does what its source does, to the bit."""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from deploy.compiling import MODULES
from protocol.process.compiled import INTERPRETED, ROOT, compiled
from tests.bench.compiled import compiled_copy

pytestmark = pytest.mark.slow

COMPILER = str(sysconfig.get_config_var("CC") or "cc").split()[0]
PLAY = """
import hashlib
from deploy.scenario_file.load import load
from deploy.launch.twin import run_twin
for name in "bad-sensors bursty computed-torque hardware hotplug-limp hysteresis storm".split():
    records, outcome = run_twin(load(name))
    told = repr((records, outcome._replace(wall_s=0.0)))
    print(name, outcome.tick, hashlib.sha256(told.encode()).hexdigest())
"""


def _said(folder: Path, *command: str) -> str:
    ended = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env=os.environ | {INTERPRETED: "0", "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason="there is no C compiler")
def test_compiled_it_says_and_does_the_same() -> None:
    """Every record: states, torques, and all that boards said. In realtime, all laws hold."""
    copy = compiled_copy()
    assert len(list(compiled(copy))) == sum(map(len, MODULES.values()))
    assert _said(copy, "-c", PLAY) == _said(ROOT, "-c", PLAY)
    _said(copy, "-m", "pytest", "-q", "tests/realtime")
