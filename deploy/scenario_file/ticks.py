"""Times that a user writes in decimals, as whole ticks."""

WHOLE_TOLERANCE = 1e-9
"""A time counts as a whole number of ticks up to what writing it in decimals loses."""


class MeaningError(ValueError):
    """A value that means nothing for this body: the key below its table, and why."""


def whole_ticks(duration_ms: float, tick_ms: float) -> int | None:
    """How many ticks a time is; None if it is no whole number of them."""
    ticks = round(duration_ms / tick_ms)
    return ticks if abs(ticks * tick_ms - duration_ms) <= WHOLE_TOLERANCE * duration_ms else None


def whole(duration_ms: float, tick_ms: float, key: str) -> int:
    """How many ticks a time is. Raises `MeaningError` if they are not whole."""
    ticks = whole_ticks(duration_ms, tick_ms)
    if ticks is None:
        raise MeaningError(f"{key}: not a whole number of ticks of {tick_ms:g} ms")
    return ticks
