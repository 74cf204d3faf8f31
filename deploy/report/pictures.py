"""The pictures of a report: named while the page is composed, and drawn together at the end.

Rule: drawing is most of the time of a report, so it is divided among the cores. A picture is the
same to the byte whoever drew it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure as Drawing

from deploy.launch.forks import divided
from deploy.launch.machine import cores
from deploy.outcome.figures import FORMATS, STYLE
from deploy.report.page import Figure, Image
from deploy.report.runs import ReportedRun

ENDINGS = ("svg", "png")


class Pictures:
    """Keeps every picture for its files."""

    def __init__(self, *, several: bool) -> None:
        self.several = several
        """Whether the report is of several runs, so that each picture must say of which."""
        self.images: list[Image] = []
        self._makes: list[Callable[[], Drawing]] = []

    def add(self, name: str, make: Callable[[], Drawing], label: str = "") -> Image:
        """Name one picture; it is there when all are drawn."""
        self.images.append(Image(name, label))
        self._makes.append(make)
        return self.images[-1]

    def each(
        self,
        name: str,
        runs: Sequence[ReportedRun],
        make: Callable[[ReportedRun], Drawing],
        **texts: Any,
    ) -> list[Figure]:
        """The same of every run, as one figure; no figure of no runs."""
        images = [
            self.add(f"{name}-{run.number}", partial(make, run), run.label)
            if self.several
            else self.add(name, partial(make, run))
            for run in runs
        ]
        return [Figure(images=images, **texts)] if images else []

    def draw(self) -> None:
        """Draw them all, in the style of all figures."""
        with style.context(["default", STYLE]):
            drawn = divided(self._drawn, len(self.images), cores())
        for image, (svg, png) in zip(self.images, drawn, strict=True):
            image.svg, image.png = svg, png

    def _drawn(self, number: int) -> tuple[bytes, ...]:
        drawing = self._makes[number]()
        return tuple(_saved(drawing, ending) for ending in ENDINGS)


def _saved(drawing: Drawing, ending: str) -> bytes:
    content = BytesIO()
    drawing.savefig(content, format=ending, metadata=FORMATS[ending])
    return content.getvalue()
