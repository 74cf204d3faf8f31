"""The runs of a report: each read once, with all that its sections are made from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from deploy.outcome.summary import Summary, summary
from deploy.recording.arrays import Recording
from deploy.recording.epochs import Epochs
from deploy.recording.link_counts import LinkCounts, counts
from deploy.recording.reading import read_recording
from deploy.report.page import Remark
from deploy.report.sections.happenings import Happening, Span, timeline, told


@dataclass(frozen=True, slots=True, eq=False)
class ReportedRun:
    """One recording and what was found in it."""

    number: int
    """Its place in the report, from 1."""
    label: str
    """Its folder's name; no two runs of a report have the same."""
    recording: Recording
    summary: Summary
    epochs: Epochs | None
    links: Sequence[LinkCounts]
    happened: Sequence[Span]
    told: Sequence[Happening]

    @property
    def joints(self) -> list[str]:
        """Names of the boards, from the ground up."""
        return self.recording.trajectory.scenario.joints

    @property
    def in_realtime(self) -> bool:
        """Whether nobody waited for anybody."""
        return self.recording.realtime is not None

    @property
    def mode(self) -> str:
        """How it was run: in processes, in the twin, or in realtime."""
        return "realtime" if self.in_realtime else str(self.summary["mode"])

    @property
    def versions(self) -> dict[str, str | None]:
        """With which versions it was run."""
        found: dict[str, str | None] = self.recording.facts.get("versions", {})
        return found

    @property
    def timed(self) -> bool:
        """Whether there are wall times: a twin has none."""
        return bool((self.recording.opened_ns > 0).any())

    def link_name(self, sender: int, receiver: int) -> str:
        """What a directed link is called."""
        return f"{self.joints[sender]} → {self.joints[receiver]}"


def read_runs(paths: Sequence[Path]) -> list[ReportedRun]:
    """Read recordings, folders or files. Raises `FailedError` with one line for the user."""
    labels: list[str] = []
    for path in paths:
        name = (path.parent if path.is_file() else path).resolve().name
        labels.append(name if name not in labels else f"{name} ({len(labels) + 1})")
    return [
        look_at(read_recording(path), label, number)
        for number, (path, label) in enumerate(zip(paths, labels, strict=True), 1)
    ]


def look_at(recording: Recording, label: str, number: int = 1) -> ReportedRun:
    """Find in a recording what the report shows."""
    trajectory = recording.trajectory
    return ReportedRun(
        number,
        label,
        recording,
        summary(
            trajectory,
            mode=recording.facts.get("mode", "processes"),
            realtime=recording.realtime,
            epochs=recording.epochs,
        ),
        recording.epochs,
        counts(recording),
        timeline(trajectory),
        told(trajectory),
    )


def titled(title: str, run: ReportedRun, runs: Sequence[ReportedRun]) -> str:
    """A title that says which run it is about, where there are several."""
    return f"{title}: {run.label}" if len(runs) > 1 else title


def remarks(
    runs: Sequence[ReportedRun], concerned: Sequence[ReportedRun], text: str
) -> list[Remark]:
    """A line about some of the runs; it names them where there are several."""
    if not concerned:
        return []
    names = ", ".join(run.label for run in concerned)
    return [Remark(text if len(runs) == 1 else f"{names}: {text}")]
