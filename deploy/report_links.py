"""What became of the frames of each directed link, counted.

Rule: every frame that was sent has one fate, so the fates add up to the frames sent.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from deploy.recording import Fate, LinkHistory, Recording
from deploy.trajectory import Floats

FATES = (
    Fate.HEARD,
    Fate.LATE,
    Fate.LOST,
    Fate.CORRUPT,
    Fate.CUT,
    Fate.NOBODY,
    Fate.VOID,
    Fate.PENDING,
)
"""What a frame that was sent can come to, from good to bad to unknown."""
Pair = tuple[int, int]


class LinkCounts(NamedTuple):
    """One directed link over the whole run."""

    sender: int
    receiver: int
    sent: int
    fates: dict[Fate, int]
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


def total(links: Sequence[LinkCounts]) -> tuple[int, dict[Fate, int]]:
    """Frames sent and their fates, over all links."""
    fates = {fate: sum(link.fates[fate] for link in links) for fate in FATES}
    return sum(link.sent for link in links), fates


def missed_share(link: LinkHistory, bin_ticks: int) -> Floats:
    """Which share of the frames sent in each stretch of ticks was not heard in the tick after.

    NaN where nothing was sent. Length: as many stretches as there are, the last may be short.
    """
    bins = np.arange(len(link.sent)) // bin_ticks
    length = int(bins[-1]) + 1 if len(bins) else 0
    sent = np.bincount(bins[link.sent], minlength=length)
    missed = np.bincount(bins[link.sent & (link.fate != Fate.HEARD)], minlength=length)
    share: Floats = np.divide(missed, sent, out=np.full(length, np.nan), where=sent > 0)
    return share


def heard_share(links: Sequence[LinkCounts]) -> float | None:
    """Share of all frames that were heard in the tick after; None when none was sent."""
    sent, fates = total(links)
    return fates[Fate.HEARD] / sent if sent else None
