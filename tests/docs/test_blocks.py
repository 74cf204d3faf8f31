"""What README and the tutorial tell their readers to type is typed, and does what they say.

All `bash` blocks of a document run in one shell, in order, in an empty folder, with real processes
on this machine. A `text` block below one is what it must print; … in it stands for anything. Three
things are not as for a reader:

- `git clone` copies this checkout, so that also what is not committed yet is tested.
- `make run` finds everything installed: `.venv` leads to the Python that runs the tests. What
  `make` installs is therefore not tested here; that is what a clean checkout in CI is for.
- The two experiments of README are cut to half a second each.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.documents import CHAPTERS, ROOT, Block, blocks

pytestmark = [pytest.mark.processes, pytest.mark.slow]

LIMIT_S = 300.0
MARK = "@@ end of block"
COPIED = ("Makefile", "pyproject.toml", "requirements.lock", "protocol", "module_agent",
          "plant_server", "deploy")  # fmt: skip
PRELUDE = """\
set -euo pipefail
export TMPDIR="$PWD"  # Robots that run on this machine meanwhile are not found.
git() {
  test "$1 $2 $3" = "clone … decmesh"
  mkdir -p decmesh/.venv/bin
  for part in {copied}; do cp -r "{root}/$part" decmesh; done
  export PYTHONPATH="$PWD/decmesh"
  printf '#!/bin/sh\\nexec "{python}" "$@"\\n' > decmesh/.venv/bin/python
  printf '#!/bin/sh\\nexec "{python}" -m deploy "$@" %s\\n' "$SHORTER" > decmesh/.venv/bin/decmesh
  echo 'export PATH="'"$PWD"'/decmesh/.venv/bin:$PATH"' > decmesh/.venv/bin/activate
  chmod +x decmesh/.venv/bin/*
  touch decmesh/.venv/run
}
"""


def script(found: list[Block], *, shorter: str) -> str:
    """One shell script of all blocks of a document; a mark stands behind each."""
    prelude = PRELUDE.replace("{root}", str(ROOT)).replace("{python}", sys.executable)
    lines = [f"SHORTER='{shorter}'", prelude.replace("{copied}", " ".join(COPIED))]
    for block in found:
        if block.file is not None:
            lines.append(f"cat > {block.file} <<'END OF FILE'\n{block.text}END OF FILE")
        elif block.kind == "bash":
            lines.append(f"{block.text}echo '{MARK}'")
    return "\n".join(lines)


def printed(found: list[Block], folder: Path, *, shorter: str = "") -> list[str]:
    """Run the blocks; what each of those in bash has printed on standard output."""
    path = folder / "blocks.sh"
    path.write_text(script(found, shorter=shorter), encoding="utf-8")
    shell = subprocess.Popen(
        ["bash", path.name],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        out, err = shell.communicate(timeout=LIMIT_S)
    finally:
        if shell.poll() is None:
            os.killpg(shell.pid, signal.SIGKILL)
    assert shell.returncode == 0, f"after:\n{out[-2000:]}\n{err[-2000:]}"
    return [part.strip("\n") for part in out.split(f"{MARK}\n")[:-1]]


def expected(found: list[Block]) -> Iterator[tuple[int, str]]:
    """Which of the bash blocks must print something, and what."""
    number = -1
    for block in found:
        if block.kind == "bash":
            number += 1
        elif block.kind == "text":
            yield number, block.text.rstrip("\n")


def check(found: list[Block], out: list[str]) -> None:
    for number, shown in expected(found):
        pattern = re.escape(shown).replace("…", ".*")
        assert re.fullmatch(pattern, out[number]), f"{out[number]!r} is not {shown!r}"


def test_the_readme_does_what_it_says(tmp_path: Path) -> None:
    found = [block for block in blocks(ROOT / "README.md") if block.kind]
    out = printed(found, tmp_path, shorter="--set run.duration_s=0.5")
    check(found, out)
    assert "Original" in out[0]
    assert "complete after 500 ticks" in out[0]
    assert next(tmp_path.glob("decmesh/runs/paper-*/comparison.png")).stat().st_size > 10_000
    assert next(tmp_path.glob("decmesh/runs/blackout-*/run.mcap")).is_file()


def test_the_tutorial_does_what_it_says(tmp_path: Path) -> None:
    """Its first block is that of README, and is tested there; here it is not run again."""
    found = [block for block in blocks(CHAPTERS / "tutorial.md") if block.kind]
    first = found[0].text
    assert first.split() == ["git", "clone", "…", "decmesh", "cd", "decmesh", "make", "run"]
    found[0] = found[0]._replace(text=first.replace("make run\n", ""))
    out = printed(found, tmp_path)
    check(found, out)
    everything = "\n".join(out)
    assert "cut" in everything
    assert "four.toml: fine; boards ankle, knee, hip, neck" in everything
    assert "one board in 30, none in 0" in " ".join(everything.split())
    assert (tmp_path / "decmesh/cable/report.html").is_file()
