"""Times as people write them."""

import argparse

import pytest

from protocol.process.durations import duration_s


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("200ms", 0.2), ("1.5s", 1.5), (".5s", 0.5), ("2min", 120.0), (" 5ms ", 0.005)],
)
def test_a_time_has_a_number_and_a_unit(text: str, seconds: float) -> None:
    assert duration_s(text) == pytest.approx(seconds)


@pytest.mark.parametrize(
    "text",
    ["", "5", "ms", "0s", "0.0ms", "-1s", "1e3s", "nan s", "inf s", "1 s", "1h", "1.s", "1s2"],
)
def test_anything_else_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="write it like 200ms"):
        duration_s(text)
