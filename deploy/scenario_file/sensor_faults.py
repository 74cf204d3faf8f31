"""Faults of sensors as people write them: how large one is, in the unit that its kind has."""

from typing import Annotated

from pydantic import BaseModel, Field

from deploy.scenario_file.fault_amount import amount_of
from deploy.scenario_file.ticks import MeaningError, whole
from protocol.robot.sensors import FaultKind, amount_trouble


class FaultAmounts(BaseModel):
    """How large a fault is; each kind of fault has one of these keys, or none."""

    period_ms: Annotated[float, Field(ge=0, le=100_000)] | None = None
    """Of "slow": from one new value to the next. None: 20 ms."""
    delay_ms: Annotated[float, Field(ge=0, le=100_000)] | None = None
    """Of "delayed": how late values are. None: 100 ms."""
    probability: Annotated[float, Field(ge=0, le=1)] | None = None
    """Of "intermittent": that there is no value in a tick. None: 0.5."""


def fault_amount(fault: FaultKind, given: FaultAmounts, *, tick_ms: float) -> float:
    """How large a fault is, in the unit of its kind: ticks or as it is. Raises `MeaningError`."""
    taken = amount_of(fault)
    for key in FaultAmounts.model_fields:
        if getattr(given, key) is not None and (taken is None or key != taken.key):
            raise MeaningError(f"{key}: a sensor that is {fault} has none")
    if taken is None:
        return 0.0
    said = getattr(given, taken.key)
    amount = taken.default if said is None else float(said)
    if taken.in_ms:
        amount = float(whole(amount, tick_ms, taken.key))
    trouble = amount_trouble(fault, amount)
    if trouble is not None:
        raise MeaningError(f"{taken.key}: {trouble}")
    return amount
