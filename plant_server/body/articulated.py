"""Dynamics of a long chain: the work grows with its links, not with their cube.

Articulated body (Featherstone), in the plane. A joint passes on a torque that is known, so what
lies above it answers the joint's acceleration a with a force that is linear in it,

    F = P a + p        P symmetric, 2 x 2; p without acceleration

From the top down, a *piece* of mass m takes up what it carries at its upper end and turns as the
moments about its own joint demand:

    J alpha = t - e'.q - h.a     J = J_0 + e'.P e'     h = s' + P e'     q = p - w^2 P e
    P <- P + m - h h^T / J       p <- q - w^2 s + h (t - e'.q) / J

with s the first moment of its mass and J_0 the second, e its upper end, all seen from its joint;
w its rate, t the torque at its joint less the one at the next, and x' what x becomes as it turns.
From the ground up, alpha follows from a, and then the next joint has a <- a + e' alpha - e w^2.
Gravity is a ground that accelerates upwards.

A piece is one link, or the links that brakes hold together (as in `clusters`). The
same equations with momenta for torques, and without rates and gravity, are those of an impact.
"""

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import accumulate, groupby
from math import cos, sin
from operator import itemgetter

from plant_server.body.chain import GRAVITY_M_S2, Chain
from plant_server.body.clusters import GROUND, clusters, differences
from plant_server.body.unrolled import LINKS_MAX
from protocol.robot.hardware import Link

Piece = tuple[float, float, float, float, float, float, float, float]
"""m, s_x, s_y, e_x, e_y, J_0, w^2, t: kg, kg m, m, kg m^2, rad^2/s^2, N m. A plain tuple, because
each is made and taken apart again in every evaluation."""


class LongChain(Chain):
    """A chain with the same answers as `Chain`, but for rounding, for a price linear in its links.

    `Chain` is faster for up to `LINKS_MAX` links, and the one to read first.
    """

    def __init__(self, links: Sequence[Link], gravity_m_s2: float = GRAVITY_M_S2) -> None:
        super().__init__(links, gravity_m_s2)
        self._constants = [
            (
                link.mass_kg,
                link.mass_kg * link.com_m,
                link.length_m,
                link.inertia_kg_m2 + link.mass_kg * link.com_m * link.com_m,
            )
            for link in self.links
        ]

    def bias_nm(self, angles_rad: Sequence[float], rates_rad_s: Sequence[float]) -> list[float]:
        """b(q, q'), as `Chain.bias_nm`."""
        return self.inverse_nm(angles_rad, rates_rad_s, [0.0] * self.size)

    def accelerations_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
    ) -> list[float]:
        """Joint accelerations, as `Chain.accelerations_rad_s2`."""
        pieces = self._pieces(angles_rad, rates_rad_s, _differences_up(torques_nm))
        return differences(_turned(pieces, 0.0, self.gravity_m_s2))

    def braked_accelerations_rad_s2(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        torques_nm: Sequence[float],
        braked: Sequence[bool],
    ) -> list[float]:
        """Joint accelerations, as `Chain.braked_accelerations_rad_s2`."""
        pieces = self._pieces(angles_rad, rates_rad_s, _differences_up(torques_nm))
        return differences(_turned_held(pieces, clusters(braked), self.gravity_m_s2))

    def braked_rates_rad_s(
        self, angles_rad: Sequence[float], rates_rad_s: Sequence[float], braked: Sequence[bool]
    ) -> list[float]:
        """Joint rates after the brakes have closed, as `Chain.braked_rates_rad_s`."""
        still = [0.0] * self.size
        pieces = self._pieces(angles_rad, still, still)
        momenta = _moments(pieces, list(accumulate(rates_rad_s)), 0.0)
        pieces = self._pieces(angles_rad, still, momenta)
        return differences(_turned_held(pieces, clusters(braked), 0.0))

    def inverse_nm(
        self,
        angles_rad: Sequence[float],
        rates_rad_s: Sequence[float],
        accelerations_rad_s2: Sequence[float],
    ) -> list[float]:
        """Torques of a motion, as `Chain.inverse_nm`."""
        pieces = self._pieces(angles_rad, rates_rad_s, [0.0] * self.size)
        loads = _moments(pieces, list(accumulate(accelerations_rad_s2)), self.gravity_m_s2)
        return list(accumulate(reversed(loads)))[::-1]

    def impulses_nms(
        self, angles_rad: Sequence[float], rate_changes_rad_s: Sequence[float]
    ) -> list[float]:
        """Impulses at the joints, as `Chain.impulses_nms`."""
        still = [0.0] * self.size
        pieces = self._pieces(angles_rad, still, still)
        momenta = _moments(pieces, list(accumulate(rate_changes_rad_s)), 0.0)
        return list(accumulate(reversed(momenta)))[::-1]

    def _pieces(
        self, angles_rad: Sequence[float], rates_rad_s: Sequence[float], torques_nm: Sequence[float]
    ) -> list[Piece]:
        """Each link in its place; `torques_nm` are those on the orientations of the links."""
        pieces: list[Piece] = []
        theta = omega = 0.0
        for (mass, moment, length, inertia), angle, rate, torque in zip(
            self._constants, angles_rad, rates_rad_s, torques_nm, strict=True
        ):
            theta += angle
            omega += rate
            x, y = sin(theta), cos(theta)
            pieces.append(
                (
                    mass,
                    moment * x,
                    moment * y,
                    length * x,
                    length * y,
                    inertia,
                    omega * omega,
                    torque,
                )
            )
        return pieces


def chain_of(links: Sequence[Link]) -> Chain:
    """The equations of motion that are the faster ones for so many links."""
    return LongChain(links) if len(links) > LINKS_MAX else Chain(links)


def _turned(pieces: Sequence[Piece], forward_m_s2: float, rise_m_s2: float) -> list[float]:
    """Angular accelerations of the pieces in space, while what they stand on accelerates."""
    answers = []
    xx = xy = yy = px = py = 0.0
    for mass, sx, sy, ex, ey, inertia, square, torque in reversed(pieces):
        # As a piece turns forward, x grows with y and y falls with x: (x, y)' = (y, -x).
        wx, wy = xx * ey - xy * ex, xy * ey - yy * ex
        qx = px - square * (xx * ex + xy * ey)
        qy = py - square * (xy * ex + yy * ey)
        hx, hy = wx + sy, wy - sx
        turning = inertia + ey * wx - ex * wy
        free = torque - ey * qx + ex * qy
        gx, gy = hx / turning, hy / turning
        xx += mass - hx * gx
        xy -= hx * gy
        yy += mass - hy * gy
        px = qx - square * sx + gx * free
        py = qy - square * sy + gy * free
        answers.append((hx, hy, turning, free, ex, ey, square))
    accelerations = []
    ax, ay = forward_m_s2, rise_m_s2
    for hx, hy, turning, free, ex, ey, square in reversed(answers):
        alpha = (free - hx * ax - hy * ay) / turning
        ax += ey * alpha - ex * square
        ay -= ex * alpha + ey * square
        accelerations.append(alpha)
    return accelerations


def _turned_held(
    pieces: Sequence[Piece], cluster_of: Sequence[int], rise_m_s2: float
) -> list[float]:
    """The same for links of which some are held together; what the ground holds keeps its rate.

    It may turn steadily, with the support. Then its end is drawn towards the ankle.
    """
    ax, ay = 0.0, rise_m_s2
    for into, (_mass, _sx, _sy, ex, ey, _inertia, square, _torque) in zip(
        cluster_of, pieces, strict=True
    ):
        if into != GROUND:
            break
        ax -= ex * square
        ay -= ey * square
    free = [*_turned(list(_joined(pieces, cluster_of)), ax, ay), 0.0]
    return [free[into] for into in cluster_of]  # Of the ground: the last, 0.0.


def _joined(pieces: Sequence[Piece], cluster_of: Sequence[int]) -> Iterator[Piece]:
    """One piece for each cluster that is free to turn, from the ground up."""
    for into, together in groupby(zip(cluster_of, pieces, strict=True), key=itemgetter(0)):
        if into != GROUND:
            yield reduce(_put_on, [piece for _into, piece in together])


def _put_on(lower: Piece, upper: Piece) -> Piece:
    """Two pieces as one, seen from the lower one's joint (Steiner)."""
    mass, sx, sy, ex, ey, inertia, square, torque = lower
    mass_2, sx_2, sy_2, ex_2, ey_2, inertia_2, _square, torque_2 = upper
    return (
        mass + mass_2,
        sx + mass_2 * ex + sx_2,
        sy + mass_2 * ey + sy_2,
        ex + ex_2,
        ey + ey_2,
        inertia + inertia_2 + mass_2 * (ex * ex + ey * ey) + 2.0 * (ex * sx_2 + ey * sy_2),
        square,
        torque + torque_2,
    )


def _moments(
    pieces: Sequence[Piece], accelerations_rad_s2: Sequence[float], rise_m_s2: float
) -> list[float]:
    """The torques on the links' orientations that give these angular accelerations in space.

    Newton and Euler, link by link: accelerations from the ground up, forces from the top down.
    """
    motions = []
    ax, ay = 0.0, rise_m_s2
    for (_mass, _sx, _sy, ex, ey, _inertia, square, _torque), alpha in zip(
        pieces, accelerations_rad_s2, strict=True
    ):
        motions.append((ax, ay, alpha))
        ax += ey * alpha - ex * square
        ay -= ex * alpha + ey * square
    moments = []
    fx = fy = 0.0
    for (mass, sx, sy, ex, ey, inertia, square, _torque), (ax, ay, alpha) in zip(
        reversed(pieces), reversed(motions), strict=True
    ):
        moments.append(inertia * alpha + sy * ax - sx * ay + ey * fx - ex * fy)
        fx += mass * ax + sy * alpha - sx * square
        fy += mass * ay - sx * alpha - sy * square
    return moments[::-1]


def _differences_up(torques_nm: Sequence[float]) -> list[float]:
    """Torques on the links' orientations: each joint turns its link, and turns the one below."""
    return [a - b for a, b in zip(torques_nm, [*torques_nm[1:], 0.0], strict=True)]
