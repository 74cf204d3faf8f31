"""Times that a user writes in decimals, as whole ticks."""

WHOLE_TOLERANCE = 1e-9
"""A time counts as a whole number of ticks up to what writing it in decimals loses."""


def whole_ticks(duration_ms: float, tick_ms: float) -> int | None:
    """How many ticks a time is; None if it is no whole number of them."""
    ticks = round(duration_ms / tick_ms)
    return ticks if abs(ticks * tick_ms - duration_ms) <= WHOLE_TOLERANCE * duration_ms else None
