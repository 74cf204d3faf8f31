"""What a process says of its machine is what the system says of it."""

import subprocess
import sys
from pathlib import Path

import pytest

from protocol.process import machine
from protocol.process.machine import EffortMeter, clock_id


def test_the_clock_has_one_name_in_all_processes_of_a_machine() -> None:
    code = "from protocol.process.machine import clock_id; print(clock_id())"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(other.stdout) == clock_id()
    assert 0 <= clock_id() < 2**32


def test_another_boot_has_another_clock_and_none_is_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = set()
    for boot in ("one", "two"):
        (tmp_path / "boot_id").write_text(boot)
        monkeypatch.setattr(machine, "BOOT_ID", tmp_path / "boot_id")
        names.add(clock_id())
    assert len(names) == 2
    monkeypatch.setattr(machine, "BOOT_ID", tmp_path / "none")
    assert clock_id() == 0


def test_effort_only_grows() -> None:
    before = EffortMeter().read()
    waste = [bytes(1 << 20) for _ in range(8)]
    number = 3**400_000
    after = EffortMeter().read()
    assert number
    assert waste
    assert after.cpu_us > before.cpu_us
    assert after.memory_kb >= before.memory_kb > 1000


@pytest.mark.skipif(not machine.STATUS.exists(), reason="needs Linux")
def test_memory_is_that_of_the_program_and_not_of_the_one_that_started_it() -> None:
    """`ru_maxrss` of a child begins with what its parent had resident."""
    waste = bytes(1 << 28)
    code = "from protocol.process.machine import *; print(EffortMeter().read().memory_kb)"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert len(waste) // 1024 > int(child.stdout) > 1000


def test_memory_is_looked_up_now_and_then() -> None:
    meter = EffortMeter()
    before = meter.read().memory_kb
    waste = [bytes(1 << 20) for _ in range(64)]
    later = [meter.read().memory_kb for _ in range(machine.MEMORY_EVERY)]
    assert waste
    assert later[0] == before < later[-1]
