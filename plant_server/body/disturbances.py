"""Disturbances: what acts on the body from outside, tick by tick: pushes that last for some ticks.

A push is a horizontal force at a link's centre of mass. What the body stands on, and how that
moves, is `plant_server.body.support`.
"""

from plant_server.body.body import Body


class Disturbances:
    """Those under way; several pushes on one link add up."""

    def __init__(self) -> None:
        self._pushes: list[tuple[int, float, int]] = []
        """Link, force in N, and how many ticks are left."""

    def push(self, link: int, force_n: float, ticks: int) -> None:
        """Push from the next tick that passes."""
        self._pushes.append((link, force_n, ticks))

    def act_on(self, body: Body) -> None:
        """Let them act on the body during a tick, which thereby has passed."""
        forces_n = [0.0] * body.chain.size
        for link, force_n, _ticks in self._pushes:
            forces_n[link] += force_n
        body.forces_n = forces_n
        self._pushes = [
            (link, force_n, ticks - 1) for link, force_n, ticks in self._pushes if ticks > 1
        ]
