"""What became of the frames of each directed link, counted.

Rule: every frame that was sent has one fate, so the fates add up to the frames sent.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deploy.recording.arrays import LinkHistory, Recording
from deploy.recording.frame_fate import FrameFate
from deploy.recording.trajectory import Floats

FATES = (
    FrameFate.HEARD,
    FrameFate.LATE,
    FrameFate.LOST,
    FrameFate.CORRUPT,
    FrameFate.CUT,
    FrameFate.NOBODY,
    FrameFate.VOID,
    FrameFate.PENDING,
)
"""What a frame that was sent can come to, from good to bad to unknown."""
MISSED = (FrameFate.LOST, FrameFate.CORRUPT, FrameFate.CUT, FrameFate.VOID)
"""What becomes of a frame that somebody was there to hear, and did not."""


class LinkCounts(NamedTuple):
    """One directed link over the whole run."""

    sender: int
    receiver: int
    sent: int
    fates: dict[FrameFate, int]
    """Each of `FATES`; they add up to `sent`."""
    refused: dict[str, int]
    bytes_sent: int


def counts(recording: Recording) -> list[LinkCounts]:
    """Count the fates on every directed link, from the ground up."""
    return [
        LinkCounts(
            sender,
            receiver,
            int(link.sent.sum()),
            {fate: int((link.sent & (link.fate == fate)).sum()) for fate in FATES},
            {reason: number for reason, number in link.refused.items() if number},
            link.bytes_sent,
        )
        for (sender, receiver), link in sorted(recording.links.items())
    ]


def total(links: Sequence[LinkCounts]) -> tuple[int, dict[FrameFate, int]]:
    """Frames sent and their fates, over all links."""
    fates = {fate: sum(link.fates[fate] for link in links) for fate in FATES}
    return sum(link.sent for link in links), fates


def missed_share(link: LinkHistory, bin_ticks: int) -> Floats:
    """Which share of the frames sent in each stretch of ticks was lost on its way, or void.

    Frames to nobody, and those that were still under way at the end, do not count. NaN where
    no frame counts. Length: as many stretches as there are; the last may be short.
    """
    bins = np.arange(len(link.sent)) // bin_ticks
    length = int(bins[-1]) + 1 if len(bins) else 0
    missed = link.sent & np.isin(link.fate, MISSED)
    counted = missed | (link.sent & np.isin(link.fate, (FrameFate.HEARD, FrameFate.LATE)))
    of = np.bincount(bins[counted], minlength=length)
    lost = np.bincount(bins[missed], minlength=length)
    share: Floats = np.divide(lost, of, out=np.full(length, np.nan), where=of > 0)
    return share
