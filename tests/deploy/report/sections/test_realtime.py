"""The report of a run in realtime: its own section in place of those that need a barrier."""

import re
from functools import cache

import numpy as np
import pytest

from deploy.recording.arrays import Recording
from deploy.recording.realtime_times import realtime_times
from deploy.report.compose import compose
from deploy.report.page import Figure, Page, PageTable
from deploy.report.runs import look_at
from deploy.report.sections.run_table import NO_BARRIER
from deploy.scenario_file.load import load
from plant_server.spool.spool import Spool
from tests.deploy.recordings import read_back, recording, run
from tests.realtime.robot import MS, Host, RealtimeRobot

pytestmark = pytest.mark.slow

BUSY = Host(busy=0.05, busy_ns=12 * MS)


@cache
def spool(*settings: str) -> Spool:
    scenario = load("paper", ["run.mode=realtime", "run.duration_s=0.5", *settings])
    return RealtimeRobot(scenario, BUSY).spool()


@cache
def by_the_wall(*settings: str) -> Recording:
    return read_back(spool(*settings))


def page_of(*recordings: Recording) -> Page:
    several = enumerate(recordings, 1)
    page, pictures = compose([look_at(of, f"run {number}", number) for number, of in several])
    pictures.draw()
    return page


def blocks(page: Page) -> dict[str, Figure | PageTable]:
    found = [block for section in page.sections for block in section.blocks]
    return {block.title: block for block in found if isinstance(block, Figure | PageTable)}


def test_it_has_a_section_of_its_own_and_none_that_needs_a_barrier() -> None:
    page = page_of(by_the_wall())
    anchors = [section.anchor for section in page.sections]
    assert anchors == ["glance", "motion", "elections", "realtime", "happenings"]
    assert {
        "Deadlines missed over time",
        "Period of each board's loop",
        "Computing time of a turn",
        "How old what was used was",
        "Wall time from an epoch's start to each decision",
        "Deadlines",
        "The loops, in ms",
        "Age of what was used, in ms",
        "Elections, decisions in ms",
    } <= set(blocks(page))
    assert page.html()
    assert not look_at(by_the_wall(), "run").happened, "nothing was done to it"


def test_every_block_has_one_sentence_on_how_to_read_it() -> None:
    for block in blocks(page_of(by_the_wall())).values():
        assert block.reading.endswith(".")
        assert not re.search(r"\. [A-Z]", block.reading), "two sentences"


def test_the_numbers_are_those_of_the_summary() -> None:
    of = look_at(by_the_wall(), "run")
    page = blocks(compose([of])[0])
    deadlines, ages = page["Deadlines"], page["Age of what was used, in ms"]
    assert isinstance(deadlines, PageTable)
    assert isinstance(ages, PageTable)
    for row, (joint, board) in zip(
        deadlines.rows, of.summary["realtime"]["boards"].items(), strict=True
    ):
        late, skipped = board["late"], board["skipped"]
        assert row[:6] == [
            joint,
            "500",
            *map(str, (board["periods"], board["in_time"], late, skipped)),
        ]
        assert row[6] == f"{100 * board['missed_share']:.2f} %"
    knee = of.summary["realtime"]["boards"]["knee"]
    by_name = {row[0]: row[1:] for row in ages.rows}
    assert float(by_name["knee: frame of hip"][1]) == knee["neighbour_age_ms"]["hip"]["p50"]
    assert float(by_name["plant: torque of knee"][4]) == knee["torque_age_ms"]["max"]


def test_beside_a_run_in_lockstep_each_says_what_it_has_not() -> None:
    page = page_of(by_the_wall(), recording(run("paper", "run.duration_s=0.3")))
    html = page.html()
    assert html.count(f"run 1: {NO_BARRIER}") == 4
    assert html.count("run 2: It ran in lockstep.") == 1
    deadlines = blocks(page)["Deadlines"]
    assert isinstance(deadlines, PageTable)
    assert deadlines.header[0] == "run"


def test_nobody_elected_is_no_table_of_elections() -> None:
    page = page_of(by_the_wall("election.enabled=false"))
    assert "Elections, decisions in ms" not in blocks(page)
    assert "Deadlines" in blocks(page)


@pytest.mark.parametrize("kept", [0.0, 0.5])
def test_a_recording_that_was_cut_off_is_told_as_far_as_it_goes(kept: float) -> None:
    whole = spool()
    ticks = whole.ticks[: 511 + int(kept * 500)]
    told = whole.realtime[: int(kept * len(whole.realtime))]
    cut = whole._replace(
        ticks=ticks, walls=whole.walls[: len(ticks)], realtime=told, outcome=None, complete=False
    )
    page = page_of(read_back(cut))
    assert "incomplete" in page.warnings[0]
    assert page.html()


def test_missed_deadlines_add_up_over_time() -> None:
    times = realtime_times(spool())
    assert times is not None
    for board in times.boards:
        assert board.missed == int(board.late.sum() + board.skipped.sum())
        assert board.periods == len(board.due_s) + int(board.skipped.sum())
        assert (np.diff(board.due_s) > 0.0).all()
