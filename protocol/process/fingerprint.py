"""Numeric fingerprint: whether two machines round as one (S19).

Equal bytes in, equal bytes out holds where every function that the loop calls rounds alike. A C
library picks its sine by the processor, so the same program may differ in a last bit elsewhere. The
fingerprint is a hash over what those functions return for fixed arguments: equal fingerprints do
not prove that two machines agree, unequal ones prove that they do not.

Rule: arguments are exact, so that they are the same everywhere, and cover the range of a body.
"""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from hashlib import sha256

SAMPLES = 2000
DIGITS = 16
_STEP = 0x9E3779B97F4A7C15
"""Odd, so the multiples of it run through all 64-bit numbers, in no visible order."""

FUNCTIONS: tuple[Callable[[float, float], float], ...] = (
    lambda a, _: math.sin(a),
    lambda a, _: math.cos(a),
    math.atan2,
    lambda a, _: math.sqrt(math.fabs(a)),
    lambda a, _: a**2,
    lambda a, b: a * b + a,
    lambda a, b: a / (1.0 + b * b),
)
"""What the loops of plant and boards call, and the operators that a compiler could fuse."""


def fingerprint(functions: Sequence[Callable[[float, float], float]] = FUNCTIONS) -> str:
    """Hash what the functions return, as hex digits."""
    digest = sha256()
    for a, b in _arguments():
        digest.update(struct.pack(f"<{len(functions)}d", *(f(a, b) for f in functions)))
    return digest.hexdigest()[:DIGITS]


def _arguments() -> Iterator[tuple[float, float]]:
    """Pairs of numbers, from tiny ones to some turns, of either sign, none of them 0."""
    for n in range(SAMPLES):
        bits = (n * _STEP) % 2**64
        fraction = 1.0 + (bits >> 12) * 2.0**-52
        other = 1.0 + (bits & 0xFFFFFFFF) * 2.0**-32
        sign = 1.0 if n % 2 else -1.0
        yield sign * math.ldexp(fraction, n % 24 - 20), math.ldexp(other, n % 7 - 3)
