"""The report of one run, or of several side by side: one HTML file, and its pictures beside it.

Rule 1: the page needs nothing but itself; the pictures beside it, drawn and as pixels, are the
        same ones, for papers and slides.
Rule 2: the same recordings give the same report, byte for byte.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from deploy.report.page import Page, Section
from deploy.report.pictures import Pictures
from deploy.report.runs import ReportedRun
from deploy.report.sections import motion_and_elections as sections
from deploy.report.sections.agreement import agreement
from deploy.report.sections.glance import glance
from deploy.report.sections.links import traffic
from deploy.report.sections.realtime import realtime
from deploy.report.sections.time import effort

REPORT = "report.html"
PICTURES = "figures"


def compose(runs: Sequence[ReportedRun], epoch: int | None = None) -> tuple[Page, Pictures]:
    """Make the page, with all that is to be drawn on it; `epoch` is drawn frame by frame.

    Raises `FailedError` if a run has no such epoch.
    """
    pictures, by_the_wall = Pictures(several=len(runs) > 1), [run.in_realtime for run in runs]
    page = Page(
        title=_names(runs),
        subtitle=_subtitle(runs),
        warnings=[_incomplete(run) for run in runs if not run.recording.complete],
        sections=[
            glance(runs),
            sections.motion(runs, pictures),
            sections.elections(runs, pictures),
            *(_of_lockstep(runs, pictures, epoch) if not all(by_the_wall) else ()),
            *([realtime(runs, pictures)] if any(by_the_wall) else ()),
            sections.happenings(runs),
        ],
        footer=f"Made with decmesh from {_names(runs)}. Every picture is in the folder {PICTURES}"
        " beside this page, as svg and png.",
    )
    return page, pictures


def _of_lockstep(
    runs: Sequence[ReportedRun], pictures: Pictures, epoch: int | None
) -> Iterator[Section]:
    """What there is where ticks wait for boards."""
    yield sections.one_epoch(runs, pictures, epoch)
    yield agreement(runs, pictures)
    yield traffic(runs, pictures)
    yield effort(runs, pictures)


def write(page: Page, pictures: Pictures, folder: Path) -> list[Path]:
    """Write the page and, in a folder beside it, its pictures; return the files, page first.

    Raises OSError.
    """
    beside = folder / PICTURES
    beside.mkdir(parents=True, exist_ok=True)
    files = {folder / REPORT: page.html().encode()}
    for image in pictures.images:
        files[beside / f"{image.name}.svg"] = image.svg
        files[beside / f"{image.name}.png"] = image.png
    for path, content in files.items():
        path.write_bytes(content)
    return list(files)


def _names(runs: Sequence[ReportedRun]) -> str:
    *others, last = (run.label for run in runs)
    return f"{', '.join(others)} and {last}" if others else last


def _subtitle(runs: Sequence[ReportedRun]) -> str:
    if len(runs) == 1:
        told: str = runs[0].recording.trajectory.scenario.description
        return told
    return f"{len(runs)} runs side by side, subject by subject, with the same scales."


def _incomplete(run: ReportedRun) -> str:
    ticks, tick_s = run.recording.trajectory.ticks, run.recording.trajectory.tick_s
    return (
        f"The recording {run.label} is incomplete: it has no end. What is here is what was"
        f" recorded until tick {ticks:,} ({ticks * tick_s:g} s)."
    )
