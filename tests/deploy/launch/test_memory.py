"""Nothing that boards or plant keep grows with the ticks; `tests/soak.py` looks for longer."""

from collections import deque

import pytest

from module_agent.firmware import body_view
from module_agent.firmware.body_view import FORGET_EVERY_TICKS
from tests import soak


@pytest.mark.parametrize("scenario", ["paper", "lossy", "hysteresis"])
def test_containers_are_bounded(scenario: str) -> None:
    assert soak.growing(scenario, 400, 400 + 63 * FORGET_EVERY_TICKS) == {}


def test_what_is_kept_in_every_tick_or_every_epoch_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The proof that the other test can fail."""
    monkeypatch.setattr(body_view, "FORGET_EVERY_TICKS", 10**9)
    grown = soak.growing("paper", 400, 2400)
    assert any(path.startswith("Twin.boards[].view.") for path in grown)


def test_elements_are_counted_wherever_they_are() -> None:
    class Kept:
        __slots__ = ("deep", "line")

        def __init__(self) -> None:
            self.line: deque[object] = deque([1, 2, 3, self])  # A ring, which must be left again.
            self.deep = {"a": [4, 5], "b": (b"six", {7})}

    assert soak.elements(Kept()) == {
        "Kept.line": 4,
        "Kept.deep": 2,
        "Kept.deep[]": 1 + 1 + 2 + 2,
        "Kept.deep[][]": 3 + 1,
    }


def line_of(*resident_kb: int, ticks_per_s: int = 2000) -> soak.Line:
    samples = [
        soak.Sample(5.0 * i, 5 * i * ticks_per_s, {"knee": kb}) for i, kb in enumerate(resident_kb)
    ]
    return soak.line(samples, "knee")


def test_a_line_is_taken_through_what_comes_after_the_warm_up() -> None:
    assert line_of(*[30_000, 33_000, 34_000], *[34_000] * 7).flat
    steady = line_of(*(34_000 + 50 * i for i in range(20)))
    assert steady.kb_per_min == pytest.approx(600.0)
    assert steady.bytes_per_tick == pytest.approx(50 * 1024 / 10_000)
    assert not steady.flat
