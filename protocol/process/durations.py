"""Times and paces as people write them on a command line: `200ms`, `1.5s`; `0.25`."""

import argparse
import re

_UNITS_S = {"ms": 1e-3, "s": 1.0, "min": 60.0}


def duration_s(text: str) -> float:
    """Read a time. Raises `argparse.ArgumentTypeError`, which is a ValueError's cousin."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+)(ms|s|min)", text.strip())
    if match is None or float(match[1]) <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no time; write it like 200ms or 1.5s")
    return float(match[1]) * _UNITS_S[match[2]]


PACE_MIN, PACE_MAX = 1e-3, 1e3


def pace(text: str) -> float:
    """Read a pace: seconds of the body in a second of the wall. Raises as `duration_s` does."""
    match = re.fullmatch(r"[0-9]*\.?[0-9]+", text.strip())
    if match is None or not PACE_MIN <= float(match[0]) <= PACE_MAX:
        raise argparse.ArgumentTypeError(f"{text!r} is no pace; write a number, such as 1 or 0.25")
    return float(match[0])
