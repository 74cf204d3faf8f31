"""A run has a folder of its own."""

import time
from pathlib import Path

import pytest

from deploy.processes import RunFailedError
from deploy.run import new_folder


def test_runs_of_the_same_second_get_folders_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _format: "20260101-120000")
    names = [new_folder(None, "paper").name for _ in range(3)]
    first = "paper-20260101-120000"
    assert names == [first, f"{first}-2", f"{first}-3"]


def test_a_folder_that_is_named_may_be_there_but_must_be_empty(tmp_path: Path) -> None:
    assert new_folder(tmp_path, "paper") == tmp_path
    (tmp_path / "mine").touch()
    with pytest.raises(RunFailedError, match="not empty"):
        new_folder(tmp_path, "paper")
