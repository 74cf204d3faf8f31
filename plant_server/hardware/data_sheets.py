"""Hardware: what the plant's motors and its foot cannot do, by their data sheets."""

from typing import NamedTuple


class MotorSheet(NamedTuple):
    """What a motor cannot do, besides its torque limit. None and zeros: nothing."""

    torque_rate_nm_s: float | None = None
    """How fast its torque can change."""
    torque_step_nm: float = 0.0
    """Its command is a whole number of such steps."""
    lag_s: float = 0.0
    """Time constant of the first-order lag from command to torque."""
    hold_ticks: int = 10
    """How long the last valid command stands in for one that is no number."""

    @property
    def ideal(self) -> bool:
        """Whether it gives at once what it is asked for."""
        return self[:3] == IDEAL[:3]


IDEAL = MotorSheet()


class FootSheet(NamedTuple):
    """The sole, from the ankle."""

    ahead_m: float
    behind_m: float
