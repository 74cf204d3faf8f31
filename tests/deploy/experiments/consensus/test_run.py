"""What was measured of consensus, summed up: rows, file, tables, figure, and the command."""

import csv
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.console import Console

from deploy.experiments.consensus.figure import consensus_figure
from deploy.experiments.consensus.network import BatchResult, Epoch, EpochBatch, pieces, play
from deploy.experiments.consensus.processes import boards_max
from deploy.experiments.consensus.run import ConsensusRow, grid, rows, spread, write_csv
from deploy.experiments.consensus.table import rounds_table, wall_table

pytestmark = pytest.mark.slow

CASES = grid(
    graphs=["line", "ring"], boards=[3, 6], losses=[0.0, 0.3], rounds=None, epochs=40, seed=2
)


@pytest.fixture(scope="module")
def found() -> list[ConsensusRow]:
    return list(rows(CASES, map(play, pieces(CASES))))


def measure(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "deploy", "measure", "consensus", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


def test_the_grid_is_every_loss_of_every_size_of_every_graph_with_the_diameter_as_r() -> None:
    assert [(case.graph, case.boards, case.loss) for case in CASES[:4]] == [
        ("line", 3, 0.0),
        ("line", 3, 0.3),
        ("line", 6, 0.0),
        ("line", 6, 0.3),
    ]
    assert [case.rounds for case in CASES] == [2, 2, 5, 5, 1, 1, 3, 3]
    assert all(case.watched_rounds >= case.rounds == case.diameter for case in CASES)


@pytest.mark.parametrize(
    ("boards", "graph", "loss", "epochs", "complaint"),
    [
        (1, "line", 0.0, 1, "1 boards: from 2"),
        (10_001, "line", 0.0, 1, "to 10000 can be measured"),
        (3, "star", 0.0, 1, "there is no graph 'star'"),
        (3, "line", 0.95, 1, "from 0 to 0.9"),
        (3, "line", -0.1, 1, "from 0 to 0.9"),
        (3, "line", float("nan"), 1, "from 0 to 0.9"),
        (1000, "line", 0.9, 10**6, "numbers of 32 bits"),
    ],
)
def test_what_cannot_be_measured_is_refused(
    boards: int, graph: str, loss: float, epochs: int, complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        grid(boards=[boards], graphs=[graph], losses=[loss], rounds=None, epochs=epochs, seed=1)


def test_percentiles_are_values_that_came_up_and_never_comes_last() -> None:
    assert spread(range(1, 101)) == (50, 90, 99, 100)
    assert spread([7]) == (7, 7, 7, 7)
    assert spread([1, None, 2]) == (2, None, None, None)
    assert spread([]) == (None, None, None, None)


def test_a_row_counts_its_epochs() -> None:
    case = CASES[0]
    epochs = [Epoch(0, 1, 1), Epoch(1, 2, 1), Epoch(2, 3, 2), Epoch(3, None, 4)]
    (row,) = rows([case], [BatchResult(case, epochs[2:]), BatchResult(case, epochs[:2])])
    assert row.epochs == 4
    assert row.agreed_in_diameter == row.agreed_in_rounds == 0.5
    assert (row.enabled_0, row.enabled_1, row.enabled_2_or_more) == (0, 2, 2)
    assert row.rounds_to_agreement == {"1": 1, "2": 1, "3": 1, "never": 1}
    assert row.agreement_rounds == (2, None, None, None)


def test_rows_come_in_the_order_of_the_grid_whoever_was_first(found: list[ConsensusRow]) -> None:
    backwards = [play(piece) for piece in reversed(pieces(CASES))]
    assert list(rows(CASES, backwards)) == found


def test_a_case_without_an_epoch_has_no_row() -> None:
    some = [play(EpochBatch(CASES[3], 0, 2)), BatchResult(CASES[0], [])]
    assert [row.boards for row in rows(CASES, some)] == [6]


def test_the_file_has_a_line_for_each_case(found: list[ConsensusRow], tmp_path: Path) -> None:
    write_csv(found, tmp_path / "consensus.csv")
    with (tmp_path / "consensus.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == len(found) == 8
    for line, row in zip(lines, found, strict=True):
        assert (line["graph"], int(line["boards"])) == (row.graph, row.boards)
        assert int(line["agreement_rounds_p99"]) == row.agreement_rounds.p99
        assert int(line["enabled_1"]) == row.enabled_1
        assert line["wall_ms_p50"] == "", "the twin has no wall time"


def shown(table: object) -> list[list[str]]:
    console = Console(width=80)
    with console.capture() as capture:
        console.print(table)
    return [line.split() for line in capture.get().splitlines()]


def test_the_table_fits_a_terminal_and_has_the_numbers_of_the_file(
    found: list[ConsensusRow],
) -> None:
    cells = [line for line in shown(rounds_table(found)) if {"0%", "30%"} & set(line)]
    assert len(cells) == 8
    for line, row in zip(cells, found, strict=True):
        shares = (row.agreed_in_diameter, row.agreed_in_rounds, *_enabled(row))
        assert line[-5:] == [f"{100.0 * share:.1f}" for share in shares]
        assert line[-9:-5] == [f"{value:.0f}" for value in row.agreement_rounds if value]
    assert not any("…" in word for line in shown(rounds_table(found)) for word in line)


def _enabled(row: ConsensusRow) -> Sequence[float]:
    counts = (row.enabled_0, row.enabled_1, row.enabled_2_or_more)
    return [count / row.epochs for count in counts]


def test_wall_time_has_a_table_and_panels_of_its_own(
    found: list[ConsensusRow], tmp_path: Path
) -> None:
    timed = [row._replace(wall_ms=spread([1.25, 2.5, 20.0])) for row in found]
    assert (
        sum(line[-4:] == ["2.50", "20.00", "20.00", "20.00"] for line in shown(wall_table(timed)))
        == 8
    )
    drawn = [
        consensus_figure(some, tmp_path / name)[0] for name, some in (("a", found), ("b", timed))
    ]
    assert drawn[0].read_bytes() != drawn[1].read_bytes()


def test_the_figure_is_the_same_for_the_same_results(
    found: list[ConsensusRow], tmp_path: Path
) -> None:
    paths = [consensus_figure(found, tmp_path / name) for name in ("a", "b")]
    assert [path.name for path in paths[0]] == ["a.svg", "a.png"]
    for one, other in zip(*paths, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_one_case_that_never_agreed_can_be_drawn(tmp_path: Path) -> None:
    case = CASES[1]
    assert consensus_figure(
        list(rows([case], [BatchResult(case, [Epoch(0, None, 2)])])), tmp_path / "x"
    )


def test_the_command_leaves_tables_file_and_figure(tmp_path: Path) -> None:
    small = ("--boards", "3,4", "--graph", "line", "--loss", "0,0.3", "--epochs", "20")
    done = measure(*small, "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert "closed form" in done.stdout
    names = ["consensus.csv", "consensus.svg", "consensus.png"]
    assert {path.name for path in tmp_path.iterdir()} == set(names)
    assert done.stdout.splitlines()[-3:] == [str(tmp_path / name) for name in names]


def test_json_has_the_same_facts_and_is_all_there_is(tmp_path: Path) -> None:
    small = ("--boards", "3", "--graph", "line", "--loss", "0.3", "--epochs", "20")
    done = measure(*small, "--out", str(tmp_path), "--json")
    assert done.stderr == ""
    told = json.loads(done.stdout)
    assert told["complete"] is True
    (case,) = told["cases"]
    assert sum(case["rounds_to_agreement"].values()) == case["epochs"] == 20
    assert {row["place"] for row in told["line_of_three"]} <= {
        "two ends",
        "end, middle",
        "middle, end",
    }
    assert [Path(path).name for path in told["files"]] == [
        "consensus.csv",
        "consensus.svg",
        "consensus.png",
    ]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--boards", "three"], "write numbers with commas between them, like 3,5,10"),
        (["--boards", "1"], "from 2 to 10000"),
        (["--graph", "star"], "there are line, ring, tree, random"),
        (["--loss", "2"], "from 0 to 0.9"),
    ],
)
def test_a_slip_is_one_line(arguments: list[str], complaint: str, tmp_path: Path) -> None:
    done = measure(*arguments, "--out", str(tmp_path / "none"))
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "none").exists(), "nothing was begun"


def test_more_processes_than_the_machine_takes_are_refused_with_how_many_it_takes(
    tmp_path: Path,
) -> None:
    too_many = str(boards_max() + 1)
    done = measure("--processes", "--boards", too_many, "--out", str(tmp_path / "none"))
    assert done.returncode == 2
    assert f"{too_many} boards are too many processes" in done.stderr
    assert not (tmp_path / "none").exists()
