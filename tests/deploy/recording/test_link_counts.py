import numpy as np
import pytest

from deploy.recording.arrays import LinkHistory
from deploy.recording.frame_fate import FrameFate
from deploy.recording.link_counts import FATES, MISSED, counts, missed_share, total
from tests.deploy.recordings import recording, run


def history(fates: list[FrameFate]) -> LinkHistory:
    size = len(fates)
    nothing = np.zeros(size, dtype=np.int64)
    return LinkHistory(
        sent=np.array([fate != FrameFate.UNSAID for fate in fates], dtype=bool),
        fate=np.array(fates, dtype=np.int64),
        heard_tick=nothing,
        frame_bytes=nothing,
        sent_ns=nothing,
        arrived_ns=nothing,
        refused={},
    )


def test_the_fates_of_all_frames_sent_add_up() -> None:
    of = recording(run("hotplug"))
    links = counts(of)
    assert [(link.sender, link.receiver) for link in links] == sorted(of.links)
    for link in links:
        fate = of.links[link.sender, link.receiver].fate
        assert sum(link.fates.values()) == link.sent == int((fate != FrameFate.UNSAID).sum())
        assert link.bytes_sent == 104 * link.sent
    assert {link.sent for link in links if link.sender == 2} == {8000}
    sent, fates = total(links)
    assert sent == sum(fates.values()) == 38_000


def test_every_fate_of_a_frame_that_was_sent_is_counted() -> None:
    assert set(FATES) == set(FrameFate) - {FrameFate.UNSAID}
    assert set(MISSED) < set(FATES)


@pytest.mark.parametrize(
    ("fates", "expected"),
    [
        ([FrameFate.HEARD, FrameFate.HEARD, FrameFate.LOST, FrameFate.LATE], [0.0, 0.5]),
        ([FrameFate.CUT, FrameFate.CORRUPT, FrameFate.VOID], [1.0, 1.0]),
        (
            [
                FrameFate.NOBODY,
                FrameFate.LOST,
                FrameFate.NOBODY,
                FrameFate.PENDING,
                FrameFate.UNSAID,
            ],
            [1.0, None, None],
        ),
        ([], []),
    ],
)
def test_a_share_is_of_the_frames_that_somebody_was_there_to_hear(
    fates: list[FrameFate], expected: list[float | None]
) -> None:
    found = missed_share(history(fates), 2)
    assert [None if np.isnan(share) else share for share in found] == expected
