"""A checkout with its control loop in C, made once for whoever asks in a process."""

import atexit
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from protocol.process.compiled import ROOT
from tests.bench.children import UnavailableError


@cache
def compiled_copy() -> Path:
    """Where it is, until this process ends. Raises `UnavailableError` if it cannot be made."""
    folder = Path(mkdtemp(prefix="decmesh-compiled-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    skipped = shutil.ignore_patterns("__pycache__", "runs", "build", ".*", "*.png", "*.so")
    shutil.copytree(ROOT, folder, ignore=skipped, dirs_exist_ok=True)
    made = subprocess.run(
        [sys.executable, "-m", "deploy.compiling"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode != 0:
        said = (made.stdout + made.stderr).strip().splitlines()
        raise UnavailableError(f"`make compiled` does not work here: {said[-1] if said else ''}")
    return folder
