"""Faults of sensors as people write them: how large one is, in the unit that its kind has."""

from deploy.scenario_file.ticks import MeaningError, whole
from protocol.robot import sensors

SLOW_MS, DELAYED_MS, INTERMITTENT = 20.0, 100.0, 0.5
"""How slow, delayed and intermittent sensors are, unless it is said."""


def fault_amount(
    fault: str,
    *,
    period_ms: float | None,
    delay_ms: float | None,
    probability: float | None,
    tick_ms: float,
) -> float:
    """How large a sensor's fault is, in the unit of its kind. Raises `MeaningError`."""
    given = {
        sensors.SLOW: ("period_ms", period_ms, SLOW_MS),
        sensors.DELAYED: ("delay_ms", delay_ms, DELAYED_MS),
        sensors.INTERMITTENT: ("probability", probability, INTERMITTENT),
    }
    for kind, (key, value, _default) in given.items():
        if value is not None and fault != kind:
            raise MeaningError(f"{key}: a sensor that is {fault} has none")
    if fault not in given:
        return 0.0
    key, value, default = given[fault]
    amount = default if value is None else value
    if fault in sensors.AMOUNT_TICKS:
        amount = float(whole(amount, tick_ms, key))
    trouble = sensors.amount_trouble(fault, amount)
    if trouble is not None:
        raise MeaningError(f"{key}: {trouble}")
    return amount
