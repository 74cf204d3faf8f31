"""Hardware: what a joint board, its motor and its link are, by their data sheets.

Rule 1: a sheet is one table of a board in the resolved scenario; its fields are the table's keys.
Rule 2: whoever wants one of them is given that sheet, and not the scenario.

Sensors have a module of their own (`protocol.robot.sensors`).
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct

NotNegative = Annotated[float, Meta(ge=0.0)]
Positive = Annotated[float, Meta(gt=0.0)]
Angle = Annotated[float, Meta(ge=-6.3, le=6.3)]
"""In radians: a turn to either side, and a little more."""
Ticks = Annotated[int, Meta(ge=0, lt=2**31)]


class Link(Struct, frozen=True, forbid_unknown_fields=True):
    """Anthropometrics of the link above a board's joint."""

    mass_kg: Positive
    length_m: Positive
    com_m: Positive
    """From the joint to the link's centre of mass."""
    inertia_kg_m2: NotNegative
    """About the link's centre of mass."""


class ServoGains(Struct, frozen=True, forbid_unknown_fields=True):
    """Gains of one module: the paper's table I, and what it leaves out (gravity weight, K_i)."""

    kp_nm_rad: NotNegative
    kd_nm_s_rad: NotNegative
    ki_nm_rad_s: NotNegative
    g_servo: NotNegative
    """Weight of the servo's torque, without a unit."""
    gravity_weight: NotNegative
    """G_g as a fraction of K_p."""
    torque_limit_nm: Positive


class ClockSheet(Struct, frozen=True, forbid_unknown_fields=True):
    """What is wrong with a board's clock and loop."""

    skew_ppm: Annotated[float, Meta(ge=-10_000.0, le=10_000.0)] = 0.0
    """Positive: fast."""
    jitter_s: NotNegative = 0.0
    """The loop starts up to so much off, all equally likely; shorter than a tick."""
    start_up_ticks: Ticks = 0
    start_up_jitter_ticks: Ticks = 0
    """From plugged in to admitted, and up to so many more, all equally likely."""
    overrun_ticks: tuple[Ticks, ...] = ()
    """Ticks that the board's loop does not finish in time."""


class MotorSheet(Struct, frozen=True, forbid_unknown_fields=True):
    """What a motor cannot do, besides its torque limit. None and zeros: nothing."""

    torque_rate_nm_s: Positive | None = None
    """How fast its torque can change; None: at once."""
    torque_step_nm: NotNegative = 0.0
    """Its command is a whole number of such steps."""
    lag_s: NotNegative = 0.0
    """Time constant of the first-order lag from command to torque."""
    hold_ticks: Ticks = 10
    """How long the last valid command stands in for one that is no number."""

    @property
    def ideal(self) -> bool:
        """Whether it gives at once what it is asked for."""
        return self.torque_rate_nm_s is None and self.torque_step_nm == self.lag_s == 0.0


class UnattendedJoint(Struct, frozen=True, forbid_unknown_fields=True):
    """What a joint without a board does (S17)."""

    how: Literal["limp", "braked", "passive"]
    """Turns freely, is locked, or has a spring and a damper."""
    stiffness_nm_rad: NotNegative
    damping_nm_s_rad: NotNegative


class PassiveElement(Struct, frozen=True, forbid_unknown_fields=True):
    """The joint's own spring and damper, beside the motor (the paper's table I: 0)."""

    rest_rad: Angle
    stiffness_nm_rad: NotNegative
    damping_nm_s_rad: NotNegative


class FootSheet(Struct, frozen=True, forbid_unknown_fields=True):
    """The sole, from the ankle."""

    ahead_m: Positive
    behind_m: Positive


STEADY = ClockSheet()
IDEAL = MotorSheet()
