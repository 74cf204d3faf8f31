"""The body as one board knows it: its own link, and one lumped mass for all that it carries.

From the top down each board adds its own link to what it heard from above and passes the sum on
(the paper's "variables are reconstructed locally using the exchanged sensory input"). So the
ankle learns the sway of the whole body while every board knows the anthropometrics of one link.

Sagittal plane; x forward, y up, in metres; orientations from the vertical, forward positive.
"""

from math import atan2, cos, sin
from typing import NamedTuple

from protocol.robot.hardware import Link


class CarriedMass(NamedTuple):
    """Everything above a joint as one mass, seen from that joint, in space."""

    mass_kg: float
    x_m: float
    y_m: float
    x_m_s: float
    y_m_s: float

    def sway_rad(self) -> float:
        """Angle of the centre of mass from the vertical through the joint (alpha_CoM; BS)."""
        return atan2(self.x_m, self.y_m)

    def sway_rad_s(self) -> float:
        """Rate of `sway_rad`."""
        distance_squared = self.x_m * self.x_m + self.y_m * self.y_m
        if distance_squared == 0.0:
            return 0.0  # A mass on the joint itself has no angle to change.
        return (self.x_m_s * self.y_m - self.x_m * self.y_m_s) / distance_squared


NOTHING = CarriedMass(0.0, 0.0, 0.0, 0.0, 0.0)


def add_link(link: Link, angle_rad: float, rate_rad_s: float, above: CarriedMass) -> CarriedMass:
    """Lump a link with what it carries at its upper end; the result is seen from its lower end."""
    sine, cosine = sin(angle_rad), cos(angle_rad)
    own, carried = link.mass_kg, above.mass_kg
    mass = own + carried
    x_m = own * link.com_m * sine + carried * (link.length_m * sine + above.x_m)
    y_m = own * link.com_m * cosine + carried * (link.length_m * cosine + above.y_m)
    across, along = cosine * rate_rad_s, -sine * rate_rad_s
    x_m_s = own * link.com_m * across + carried * (link.length_m * across + above.x_m_s)
    y_m_s = own * link.com_m * along + carried * (link.length_m * along + above.y_m_s)
    return CarriedMass(mass, x_m / mass, y_m / mass, x_m_s / mass, y_m_s / mass)


class CarriedShape(NamedTuple):
    """Where the mass above was, relative to the link that carries it, when last heard of."""

    mass_kg: float
    along_m: float
    across_m: float


def shape_of(above: CarriedMass, angle_rad: float) -> CarriedShape:
    """Express what lies above in the frame of the link below it."""
    sine, cosine = sin(angle_rad), cos(angle_rad)
    return CarriedShape(
        mass_kg=above.mass_kg,
        along_m=above.x_m * sine + above.y_m * cosine,
        across_m=above.x_m * cosine - above.y_m * sine,
    )


def carried_rigidly(shape: CarriedShape, angle_rad: float, rate_rad_s: float) -> CarriedMass:
    """Turn a remembered shape with its link, as if it were bolted to it (S9)."""
    sine, cosine = sin(angle_rad), cos(angle_rad)
    x_m = shape.along_m * sine + shape.across_m * cosine
    y_m = shape.along_m * cosine - shape.across_m * sine
    return CarriedMass(shape.mass_kg, x_m, y_m, y_m * rate_rad_s, -x_m * rate_rad_s)
