"""Which faults of sensors have a size, under which key, and what it is unless it is said."""

from typing import NamedTuple, assert_never

from protocol.robot.sensors import FaultKind


class Amount(NamedTuple):
    """The key that says how large a fault is, and what it is unless it is said."""

    key: str
    default: float

    @property
    def in_ms(self) -> bool:
        """Whether it is a time, which counts in ticks."""
        return self.key.endswith("_ms")


def amount_of(fault: FaultKind) -> Amount | None:
    """What a kind of fault takes; None: nothing."""
    match fault:
        case "slow":
            return Amount("period_ms", 20.0)
        case "delayed":
            return Amount("delay_ms", 100.0)
        case "intermittent":
            return Amount("probability", 0.5)
        case "ok" | "off" | "stuck" | "garbage":
            return None
        case _:
            assert_never(fault)
