"""How decmesh speaks: nothing cut, nothing lost, and programs get the same facts."""

import errno
import json
import os
from pathlib import Path
from typing import NamedTuple

import pytest
from rich.table import Table

from deploy.commands.terminal import print_json, print_table, progress, tell
from deploy.failure import FailedError
from protocol.process.exit_codes import ExitCode


class Pair(NamedTuple):
    one: float
    other: float | None


def table() -> Table:
    found = Table("number", box=None)
    found.add_row("123456789" * 12, style="red")
    return found


def test_names_paths_and_what_is_no_number_become_json(capsys: pytest.CaptureFixture[str]) -> None:
    value = {"pairs": [Pair(1.5, None), Pair(float("nan"), float("inf"))], "file": Path("a/b")}
    print_json(value)
    assert json.loads(capsys.readouterr().out) == {
        "pairs": [{"one": 1.5, "other": None}, {"one": None, "other": None}],
        "file": "a/b",
    }


def test_a_table_is_not_cut_and_not_coloured_in_a_pipe(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "20")
    print_table(table())
    said = capsys.readouterr().out
    assert "123456789" * 12 in said
    assert "\x1b" not in said


def test_a_bar_is_for_terminals_only(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("work", 10) as advance:
        advance(5)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("as_json", [True, False])
def test_a_full_disk_loses_the_files_and_nothing_else(
    capsys: pytest.CaptureFixture[str], *, as_json: bool
) -> None:
    def write() -> list[Path]:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/te.csv")

    with pytest.raises(FailedError, match=r"^cannot write out/te\.csv: No space left") as caught:
        tell({"runs": [1, 2]}, [table(), "A legend."], write, as_json=as_json)
    assert caught.value.code == ExitCode.NO_OUTPUT
    said = capsys.readouterr().out
    if as_json:
        assert json.loads(said) == {"runs": [1, 2], "files": []}
    else:
        assert "123456789" in said
        assert "A legend." in said
