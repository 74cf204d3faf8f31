"""Facts of a run: plain JSON that says when, where and with what."""

import json
import os
import platform
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from plant_server.spool import facts
from protocol.process.fingerprint import fingerprint
from protocol.process.machine import clock_id


def test_they_say_when_where_and_with_what() -> None:
    before = datetime.now(UTC)
    found = facts.facts("twin")
    assert json.loads(json.dumps(found)) == found
    assert found["mode"] == "twin"
    started = datetime.fromisoformat(found["started"])
    assert abs(started - before) < timedelta(seconds=30)
    assert started.utcoffset() == timedelta(0)
    assert found["versions"]["python"] == platform.python_version()
    assert None not in found["versions"].values()
    assert (found["clock"], found["fingerprint"]) == (clock_id(), fingerprint())


def test_they_say_what_kind_of_machine_it_is_but_not_whose() -> None:
    host = facts.host()
    assert host["cores"] == os.cpu_count()
    assert host["machine"] == platform.machine()
    assert platform.node() not in host.values()


def test_what_a_system_does_not_tell_is_null(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(facts, "CPU_INFO", tmp_path / "none")
    assert facts.host()["cpu"] is None
    (tmp_path / "cpuinfo").write_text("processor\t: 0\nmodel name\t: Abacus 2\n")
    monkeypatch.setattr(facts, "CPU_INFO", tmp_path / "cpuinfo")
    assert facts.host()["cpu"] == "Abacus 2"
    monkeypatch.setitem(facts.DISTRIBUTIONS, "nothing", "no-such-distribution")
    assert facts.versions()["nothing"] is None
