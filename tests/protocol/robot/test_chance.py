"""The one hash: what is drawn from it, and that draws do not disturb each other."""

from math import erf, sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.robot.chance import GARBAGE, JITTER, Chance, draw, mix

N = 20_000


def test_mix_is_splitmix64() -> None:
    """The first numbers of its published stream for seed 0, and the well-known 1234567."""
    golden = 0x9E3779B97F4A7C15
    stream = [mix(n * golden % 2**64) for n in range(3)]
    assert stream == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    assert mix(1234567) == 6457827717110365317


@given(*[st.integers(0, 2**64 - 1)] * 2)
@settings(derandomize=True, deadline=None)
def test_mix_loses_nothing(one: int, other: int) -> None:
    """It is a bijection: two values never become the same."""
    assert (mix(one) == mix(other)) == (one == other)


@given(
    seed=st.integers(0, 2**63 - 1), board=st.integers(0, 1999), tick=st.integers(-(2**31), 2**31)
)
@settings(derandomize=True, deadline=None)
def test_a_board_draws_as_a_link_from_itself_to_itself(seed: int, board: int, tick: int) -> None:
    chance = Chance(seed=seed, board=board)
    assert chance.draw(tick, JITTER) == draw(seed, board, board, tick, JITTER)
    assert 0.0 <= chance.uniform(tick, JITTER) < 1.0


def normals(seed: int = 1, purpose: int = JITTER) -> list[float]:
    chance = Chance(seed=seed, board=2)
    return [chance.normal(tick, purpose) for tick in range(N)]


def test_normal_draws_are_normal() -> None:
    """Mean and variance within four of their standard errors; the distribution within what
    Kolmogorov and Smirnov allow to one in a thousand."""
    drawn = sorted(normals())
    mean = sum(drawn) / N
    variance = sum((x - mean) ** 2 for x in drawn) / N
    assert abs(mean) < 4.0 / sqrt(N)
    assert abs(variance - 1.0) < 4.0 * sqrt(2.0 / N)
    cumulative = [0.5 * (1.0 + erf(x / sqrt(2.0))) for x in drawn]
    assert max(abs(p - (i + 0.5) / N) for i, p in enumerate(cumulative)) < 1.95 / sqrt(N)
    assert max(map(abs, drawn)) < 6.7


@pytest.mark.parametrize("lag", [1, 2, 10])
def test_one_tick_says_nothing_of_another(lag: int) -> None:
    drawn = normals()
    product = sum(a * b for a, b in zip(drawn, drawn[lag:], strict=False)) / N
    assert abs(product) < 4.0 / sqrt(N)


def test_one_purpose_says_nothing_of_another() -> None:
    product = sum(a * b for a, b in zip(normals(), normals(purpose=GARBAGE), strict=True)) / N
    assert abs(product) < 4.0 / sqrt(N)
