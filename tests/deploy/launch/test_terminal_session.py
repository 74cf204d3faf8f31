"""What a terminal says to a robot: which robot, which link, and what is shown of it."""

from pathlib import Path
from typing import Any

import pytest

from deploy.launch import rigs
from deploy.launch.status import status_shown
from deploy.launch.terminal_session import LiveError, find_rig, pairs_of

STATUS: dict[str, Any] = {"boards": [{"joint": name} for name in ("ankle", "knee", "hip")]}


@pytest.mark.parametrize(
    ("link", "line"),
    [
        ("ankle", "'ankle' is no link; write it like ankle-knee"),
        ("", "'' is no link"),
        ("toe-knee", "there is no joint 'toe'; there are ankle, knee, hip"),
        ("ankle-knee-hip", "there is no joint 'knee-hip'"),
        ("ankle-", "there is no joint ''"),
        ("ankle-hip", "ankle and hip are no neighbours"),
        ("knee-knee", "knee and knee are no neighbours"),
    ],
)
def test_a_link_that_is_none_is_refused_in_one_line(link: str, line: str) -> None:
    with pytest.raises(LiveError, match=line):
        pairs_of(link, STATUS, one_way=False)


@pytest.fixture
def two_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two that are said to run, the first with its results in `tmp_path`."""
    monkeypatch.chdir(tmp_path)
    place = {"name": "robot", "host": "127.0.0.1", "scenario": "paper"}
    found = [
        {**place, "base_port": 17700, "run": str(tmp_path / "first")},
        {**place, "base_port": 17732, "run": str(tmp_path / "second")},
    ]
    monkeypatch.setattr(rigs, "running", lambda: found)


@pytest.mark.usefixtures("two_robots")
@pytest.mark.parametrize("wanted", ["17732", "second", "./second/"])
def test_a_robot_is_found_by_its_port_or_its_run_folder(wanted: str) -> None:
    assert find_rig(wanted).base_port == 17732


@pytest.mark.usefixtures("two_robots")
@pytest.mark.parametrize(
    ("wanted", "line"),
    [
        (None, "several robots are running; choose with --rig: 17700"),
        ("paper", "several robots are called 'paper'; choose with --rig: 17700"),
        ("third", "no running robot is called 'third'; choose with --rig: 17700"),
    ],
)
def test_a_robot_that_is_not_clear_is_asked_for(wanted: str | None, line: str) -> None:
    with pytest.raises(LiveError, match=line):
        find_rig(wanted)


def test_a_link_that_is_cut_is_shown_as_cut() -> None:
    link = {"from": "knee", "to": "ankle", "faults": {"cut": 1.0, "loss": 0.2}, "one_way": False}
    status = {"tick": 1, "tick_s": 0.001, "waits_for": [], "boards": [], "sensor_faults": []}
    *_, table = status_shown({**status, "links": [link], "storms": []})
    assert not isinstance(table, str)
    assert list(table.columns[1].cells) == ["cut, loss 0.2"]
