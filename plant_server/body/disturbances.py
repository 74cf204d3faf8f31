"""Pushes: horizontal forces on links that last for some ticks."""


class Pushes:
    """Those under way; several on one link add up."""

    def __init__(self, links: int) -> None:
        self._links = links
        self._under_way: list[list[float]] = []

    def add(self, link: int, force_n: float, ticks: int) -> None:
        """Push from the next tick that passes."""
        self._under_way.append([link, force_n, ticks])

    def forces_n(self) -> list[float]:
        """The forces of a tick, which thereby has passed."""
        forces_n = [0.0] * self._links
        for push in self._under_way:
            forces_n[int(push[0])] += push[1]
            push[2] -= 1
        self._under_way = [push for push in self._under_way if push[2] > 0]
        return forces_n
