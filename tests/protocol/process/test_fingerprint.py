"""The numeric fingerprint tells machines apart that round differently, be it in one last bit."""

import math
from collections.abc import Callable

import pytest

from protocol.process.fingerprint import DIGITS, FUNCTIONS, SAMPLES, fingerprint


def off_by_one_bit(
    function: Callable[[float, float], float], where: int
) -> Callable[[float, float], float]:
    """The same function, with another last bit in one of its results."""
    calls = 0

    def off(a: float, b: float) -> float:
        nonlocal calls
        calls += 1
        value = function(a, b)
        return math.nextafter(value, math.inf) if calls == where else value

    return off


def test_it_is_the_same_each_time() -> None:
    assert fingerprint() == fingerprint()
    assert len(fingerprint()) == DIGITS


@pytest.mark.parametrize("n", range(len(FUNCTIONS)))
@pytest.mark.parametrize("where", [1, SAMPLES // 2, SAMPLES])
def test_one_bit_of_one_result_shows(n: int, where: int) -> None:
    others = list(FUNCTIONS)
    others[n] = off_by_one_bit(FUNCTIONS[n], where)
    assert fingerprint(others) != fingerprint()


def test_the_functions_see_what_a_body_has() -> None:
    """Angles from a thousandth of a degree to some turns, of both signs, and no two alike."""
    seen: list[float] = []

    def look(a: float, _b: float) -> float:
        seen.append(a)
        return a

    fingerprint([look])
    assert len(set(seen)) == SAMPLES
    assert min(map(abs, seen)) < math.radians(1e-3)
    assert max(seen) > 2.0 * math.pi
    assert min(seen) < -2.0 * math.pi
