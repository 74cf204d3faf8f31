"""Realtime mode in a scenario: what a file may say, what does not fit, and what it becomes."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from deploy.scenario_file.ticks import whole_ticks
from protocol.robot.scenario import RealtimeSettings

SETTLE_MS = 500.0
"""How long boards have, besides their delay line, to learn the plant's clock before the release."""
PERIODS_PER_ROUND = 2
"""Of the slowest board: one until it looks, one for the frame to travel."""
AHEAD_MS = 250.0
"""By so much clocks may differ, on a host that is far too slow."""
AGE_PERIODS_MIN = 2

Rate = Annotated[float, Field(gt=0, le=10_000, allow_inf_nan=False)]


class RealtimeTable(BaseModel):
    """How boards behave when nobody is waited for."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    rate_hz: Rate = 500.0
    """Of every board's loop that has none of its own; a period is a whole number of ticks."""
    missed: Literal["skip", "catch-up"] = "skip"
    """Periods that a board was too late for are left out, or made up for, up to 10."""
    age_max_ms: Annotated[float, Field(gt=0, le=100_000, allow_inf_nan=False)] = 50.0
    """An older torque is not applied; a board with an older observation drives no more."""


class Rounds(NamedTuple):
    """What an election asks for: T_e, and R."""

    period_ms: float
    rounds: int


def realtime_misfits(
    table: object,
    rates_hz: Sequence[float | None],
    *,
    tick_ms: float,
    pace: float | None,
    rounds: Rounds | None,
) -> Iterator[str]:
    """What does not go together in realtime, each as `path: reason`."""
    if pace is not None:
        yield "run.pace: realtime goes at the pace of the wall clock; leave it out"
    try:
        realtime = RealtimeTable.model_validate(table)
    except ValidationError:
        return  # That has been complained about already.
    periods_ms = []
    for i, own_hz in enumerate(rates_hz):
        rate_hz = own_hz or realtime.rate_hz
        if whole_ticks(1e3 / rate_hz, tick_ms):
            periods_ms.append(1e3 / rate_hz)
        elif own_hz or i == 0:
            path = f"board.{i}.rate_hz" if own_hz else "realtime.rate_hz"
            period = f"{1e3 / rate_hz:.4g} ms at {rate_hz:g} Hz"
            yield f"{path}: a period of {period} is not a whole number of ticks of {tick_ms:g} ms"
    if not periods_ms:
        return
    slowest_ms = max(periods_ms)
    if realtime.age_max_ms < AGE_PERIODS_MIN * slowest_ms:
        yield (
            f"realtime.age_max_ms: {realtime.age_max_ms:g} ms is less than"
            f" {AGE_PERIODS_MIN} periods of the slowest board, {slowest_ms:g} ms each"
        )
    if rounds is None:
        return
    round_ms = PERIODS_PER_ROUND * slowest_ms
    if rounds.period_ms // round_ms <= rounds.rounds:
        yield (
            f"election.rounds: in realtime a round takes {round_ms:g} ms, two periods of the"
            f" slowest board; {rounds.rounds} of them, and one to begin, do not fit into a period"
            f" of {rounds.period_ms:g} ms"
        )


def resolve_realtime(
    realtime: RealtimeTable, rates_hz: Sequence[float | None], tick_ms: float
) -> tuple[RealtimeSettings, list[int]]:
    """What boards have in common, and the plant ticks in a period of each."""
    periods = [whole_ticks(1e3 / (rate or realtime.rate_hz), tick_ms) or 1 for rate in rates_hz]
    settings = RealtimeSettings(
        ticks_per_round=PERIODS_PER_ROUND * max(periods),
        settle_ticks=round(SETTLE_MS / tick_ms),
        ahead_ticks_max=round(AHEAD_MS / tick_ms),
        age_ticks_max=int(realtime.age_max_ms / tick_ms),
        missed=realtime.missed,
    )
    return settings, periods
