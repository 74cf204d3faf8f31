"""Disturbances: what acts on the body from outside, tick by tick: pushes that last for some ticks.

A push is a horizontal force at a link's centre of mass. What the body stands on, and how that
moves, is `plant_server.body.support`.
"""

from typing import assert_never

from plant_server.body.body import Body
from protocol.robot.events import Disturbance, Push


class Disturbances:
    """Those under way; several pushes on one link add up."""

    def __init__(self) -> None:
        self._pushes: list[tuple[int, float, int]] = []
        """Link, force in N, and how many ticks are left."""

    def begin(self, disturbance: Disturbance) -> None:
        """Let one act from the next tick that passes."""
        match disturbance:
            case Push():
                self._pushes.append((disturbance.link, disturbance.force_n, disturbance.ticks))
            case _:
                assert_never(disturbance)

    def act_on(self, body: Body) -> None:
        """Let them act on the body during a tick, which thereby has passed."""
        forces_n = [0.0] * body.chain.size
        for link, force_n, _ticks in self._pushes:
            forces_n[link] += force_n
        body.forces_n = forces_n
        self._pushes = [
            (link, force_n, ticks - 1) for link, force_n, ticks in self._pushes if ticks > 1
        ]
