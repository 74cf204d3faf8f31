"""The whole report: what is on it, that it is small, and the command that writes it."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deploy.failure import FailedError
from deploy.launch import run as runs
from deploy.launch.processes import LaunchWatch
from deploy.outcome import results
from deploy.recording.arrays import Recording
from deploy.recording.frame_fate import FrameFate
from deploy.recording.trajectory import Trajectory
from deploy.report.compose import PICTURES, REPORT, compose, write
from deploy.report.page import Figure, Page, PageTable
from deploy.report.pictures import Pictures
from deploy.report.runs import look_at
from deploy.report.sections.links import NO_SHARED_CLOCK, traffic
from deploy.report.sections.motion_and_elections import motion, one_epoch
from deploy.report.sections.run_table import NO_WALL_TIME
from deploy.scenario_file.load import load
from protocol.process.exit_codes import ExitCode
from tests.deploy.recordings import chain, recording, run

pytestmark = pytest.mark.slow

BYTES_MAX = 5_000_000


def cut(of: Trajectory, ticks: int) -> Trajectory:
    """The first ticks of a run."""
    names = ("torques_nm", "controlled_rad", "state", "enabled", "epoch", "round", "urgency")
    return replace(
        of,
        angles_rad=of.angles_rad[: ticks + 1],
        rates_rad_s=of.rates_rad_s[: ticks + 1],
        candidate=of.candidate[:ticks],
        **{name: getattr(of, name)[:ticks] for name in names},
    )


def page_of(*recordings: Recording) -> Page:
    several = enumerate(recordings, 1)
    page, pictures = compose([look_at(of, f"run {number}", number) for number, of in several])
    pictures.draw()
    return page


def titles(page: Page) -> list[str]:
    blocks = [block for section in page.sections for block in section.blocks]
    return [block.title for block in blocks if isinstance(block, Figure | PageTable)]


def figures(page: Page) -> dict[str, list[str]]:
    """Titles, and of which runs each has pictures."""
    return {
        block.title: [image.label for image in block.images]
        for section in page.sections
        for block in section.blocks
        if isinstance(block, Figure)
    }


@pytest.fixture(scope="module")
def storm() -> Page:
    return page_of(recording(run("storm")))


@pytest.fixture(scope="module")
def three() -> Page:
    """Side by side: clocks of their own and no end; nobody elected; a twin."""
    lossy = recording(run("lossy", "run.duration_s=0.5"))
    return page_of(
        replace(lossy, clocks_shared=False, complete=False),
        recording(run("paper", "run.duration_s=0.4", "election.enabled=false")),
        recording(run("paper", "run.duration_s=0.3"), timed=False),
    )


def test_every_figure_and_table_has_one_sentence_on_how_to_read_it(storm: Page) -> None:
    blocks = [block for section in storm.sections for block in section.blocks]
    readings = [block.reading for block in blocks if isinstance(block, Figure | PageTable)]
    assert len(readings) > 15
    for reading in readings:
        assert reading.endswith(".")
        assert not re.search(r"\. [A-Z]", reading), "two sentences"


def test_all_subjects_are_there(storm: Page) -> None:
    anchors = [section.anchor for section in storm.sections]
    assert anchors == [
        "glance", "motion", "elections", "epoch", "agreement", "links", "time", "happenings",
    ]  # fmt: skip
    assert len(titles(storm)) == len(set(titles(storm)))
    assert storm.warnings == []


def test_runs_stand_side_by_side(three: Page) -> None:
    (glance,) = three.sections[0].blocks
    assert isinstance(glance, PageTable)
    assert glance.header == ["", "run 1", "run 2", "run 3"]
    drawn = figures(three)
    assert drawn["Elections over time"] == ["run 1", "run 2", "run 3"]
    assert drawn["One epoch, frame by frame"] == ["run 1", "run 3"]
    assert drawn["Wall time of a tick"] == ["run 1", "run 2"]
    assert "run 2: All boards move all the time" in three.html()


def test_a_twin_says_that_it_has_no_wall_time(three: Page) -> None:
    """Once where a decision, a frame's way and a tick would have taken time."""
    assert three.html().count(f"run 3: {NO_WALL_TIME}") == 3
    timed = [found for title, found in figures(three).items() if "time" in title.lower()]
    assert len(timed) > 1
    assert [found for found in timed if "run 3" in found] == [["run 1", "run 2", "run 3"]]


def test_processes_without_a_shared_clock_say_why_no_way_is_timed(three: Page) -> None:
    assert f"run 1: {NO_SHARED_CLOCK}" in three.html()
    assert figures(three)["How long frames were on their way"] == ["run 2"]


def test_heard_late_and_lost_are_counted_also_where_there_are_none() -> None:
    of = recording(run("paper", "run.duration_s=0.3"))
    links = {
        pair: replace(link, fate=np.full_like(link.fate, FrameFate.CUT))
        for pair, link in of.links.items()
    }
    blocks = traffic([look_at(replace(of, links=links), "run")], Pictures(several=False)).blocks
    (counted,) = (
        block
        for block in blocks
        if isinstance(block, PageTable) and block.title == "Frames of each directed link"
    )
    assert counted.header == ["link", "sent", "heard", "late", "lost", "cut", "bytes", "refused"]


def test_a_recording_without_an_end_is_marked_on_top(three: Page) -> None:
    (warning,) = three.warnings
    assert "run 1 is incomplete" in warning
    assert "tick 500 (0.5 s)" in warning


def test_the_same_recording_gives_the_same_page() -> None:
    pages = [page_of(recording(run("lossy", "run.duration_s=0.5"))).html() for _ in range(2)]
    assert pages[0] == pages[1]


@pytest.mark.parametrize(("name", "published"), [("paper", 1), ("lossy", 0)])
def test_the_papers_numbers_stand_beside_ours_in_the_papers_scenario_only(
    name: str, published: int
) -> None:
    of = look_at(recording(run(name, "run.duration_s=0.5")), "run")
    pictures = Pictures(several=False)
    page = Page("", "", [motion([of], pictures)])
    pictures.draw()
    written = page.html()
    assert written.count("published, distributed") == published
    assert written.count(">2.1166°<") == published


@pytest.mark.parametrize("ticks", [0, 1, 2, 3])
def test_a_run_may_be_short(ticks: int) -> None:
    """Two ticks are too few for an epoch of two rounds; three are not."""
    page = page_of(recording(cut(run("paper", "run.duration_s=0.5"), ticks)))
    assert ("One epoch, frame by frame" in titles(page)) == (ticks > 2)
    assert page.html()


def test_one_board_has_no_links(tmp_path: Path) -> None:
    path = tmp_path / "pole.toml"
    path.write_text(
        '[run]\nduration_s = 0.3\n[[board]]\njoint = "base"\ncontrols = "body-sway"\n'
        "initial_deg = 5.0\nimu = true\n[board.servo]\nkp_nm_rad = 100.0\nkd_nm_s_rad = 25.0\n"
        '[board.link]\nname = "pole"\nmass_kg = 10.0\nlength_m = 1.0\ncom_m = 0.5\n',
        encoding="utf-8",
    )
    page = page_of(recording(run(str(path))))
    assert "One board has no links." in page.html()
    assert "For whom the plant waited" in titles(page)


def test_ten_boards_and_a_hundred_seconds_fit(tmp_path: Path) -> None:
    page = page_of(recording(chain(tmp_path, 10, 100.0)))
    assert len(page.html()) < BYTES_MAX


def test_an_epoch_can_be_chosen_and_one_that_is_not_there_is_refused() -> None:
    of = look_at(recording(run("lossy", "run.duration_s=0.5")), "run")
    chosen = [Pictures(several=False) for _ in range(5)]
    for number, pictures in enumerate(chosen):
        one_epoch([of], pictures, number)
        pictures.draw()
    assert len({pictures.images[0].svg for pictures in chosen}) == 5
    with pytest.raises(FailedError, match="run has no epoch 5; it has 0 to 4") as failed:
        one_epoch([of], Pictures(several=False), 5)
    assert failed.value.code == ExitCode.BAD_INPUT


def test_each_picture_is_written_beside_the_page_drawn_and_as_pixels(tmp_path: Path) -> None:
    composed = compose([look_at(recording(run("lossy", "run.duration_s=0.5")), "run")])
    composed[1].draw()
    page, *pictures = write(*composed, tmp_path)
    assert page == tmp_path / REPORT
    names = [image.name for image in composed[1].images]
    assert len(names) == len(set(names)) > 7
    assert sorted(pictures) == sorted(
        tmp_path / PICTURES / f"{name}.{ending}" for name in names for ending in ("svg", "png")
    )
    for path in pictures:
        start = b"<?xml" if path.suffix == ".svg" else b"\x89PNG"
        assert path.read_bytes().startswith(start)


def report(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "deploy", "report", *arguments],
        capture_output=True, text=True, check=False, timeout=120, cwd=cwd,
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the twin, as `decmesh run` leaves it."""
    path = tmp_path_factory.mktemp("runs") / "short"
    path.mkdir()
    scenario = load("lossy", ["run.duration_s=0.3"])
    runs.run(scenario, path, twin=True, watch=LaunchWatch(lambda _tick: None, lambda _line: None))
    done = results.conclude(path, "twin")
    assert done is not None
    assert len(list(results.write(done, path, lambda _tick: None))) == 2
    return path


def test_the_command_writes_into_the_run_and_says_where(folder: Path) -> None:
    done = report(str(folder), "--epoch", "1", cwd=folder.parent)
    assert done.returncode == ExitCode.OK, done.stderr
    assert done.stdout.splitlines()[0] == str(folder / REPORT)
    assert "<h1>short</h1>" in (folder / REPORT).read_text(encoding="utf-8")


def test_the_command_puts_several_runs_into_a_folder_of_their_own(folder: Path) -> None:
    done = report(str(folder), str(folder), cwd=folder.parent)
    assert done.returncode == ExitCode.OK, done.stderr
    page = folder.parent / done.stdout.splitlines()[0]
    assert page.parent.parent == folder.parent / "runs"
    assert "short and short (2)" in page.read_text(encoding="utf-8")


def test_what_cannot_be_reported_is_one_line_and_leaves_nothing(
    folder: Path, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.touch()
    for arguments, code, hint in (
        ([str(tmp_path)], ExitCode.BAD_INPUT, str(tmp_path)),
        ([str(folder), str(folder), "--epoch", "9"], ExitCode.BAD_INPUT, "no epoch 9"),
        ([str(folder), "--out", str(file / "below")], ExitCode.NO_OUTPUT, "choose another --out"),
    ):
        done = report(*arguments, cwd=tmp_path)
        assert done.returncode == code, done.stderr
        assert hint in done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == [file]
