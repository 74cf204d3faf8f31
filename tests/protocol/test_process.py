"""How a process is begun again and ended."""

import subprocess
import sys
from pathlib import Path

STUCK_ONCE = """
import sys, threading
from pathlib import Path
from protocol.process import restarted_when_stuck

first = not Path(sys.argv[1]).exists()
Path(sys.argv[1]).touch()
with restarted_when_stuck(0.2 if first else 60.0):
    if first:
        threading.Lock().acquire() and threading.Event().wait()
print("joined", *sys.argv[2:])
"""


def test_a_process_that_is_stuck_at_its_start_begins_again(tmp_path: Path) -> None:
    """With the same arguments, as the same process."""
    program = tmp_path / "program.py"
    program.write_text(STUCK_ONCE)
    command = [sys.executable, str(program), str(tmp_path / "begun"), "an", "argument"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "joined an argument\n"
    assert "starting again" in done.stderr
