"""A board's place on the network: what it declares, and where it leaves what comes.

What comes each tick is left by a function written in C (`SimpleQueue.put`, `deque.append`): a
Python function, called from a thread that Python did not start, costs more than the tick.
"""

from collections import deque
from queue import SimpleQueue
from typing import Any

import zenoh

from module_agent.board import Actuation
from module_agent.config import BoardConfig
from protocol import keys

END, PLANT, REPLY, MATCHING = range(4)
Event = tuple[int, Any]
"""A kind, and what the network brought of it."""


class Post:
    """Publishers and subscribers of one board."""

    heard_max: int | None = None
    """How many frames of a neighbour are kept until they are looked at; None: all."""

    def __init__(self, session: zenoh.Session, config: BoardConfig, *, rig: str, boot: int) -> None:
        self.session = session
        self.events: SimpleQueue[zenoh.Sample | Event] = SimpleQueue()
        """Observations as they come, everything else with its kind."""
        self.heard: list[deque[zenoh.Sample]] = [
            deque(maxlen=self.heard_max) for _ in config.neighbours
        ]
        """Frames of each neighbour. They wake nobody: without an observation they are no use."""
        joint, alive = config.joint, session.liveliness()
        self._torque = self._publisher(keys.torque(rig, joint))
        self._stalled = self._publisher(keys.stalled(rig, joint))
        self._links = [
            self._publisher(keys.link(rig, joint, neighbour))
            for neighbour in config.neighbour_joints
        ]
        self._declared = [
            session.declare_subscriber(keys.observation(rig, joint), self._observed()),
            session.declare_subscriber(keys.end(rig), self._left(END)),
            *(
                session.declare_subscriber(
                    keys.link(rig, neighbour, joint),
                    zenoh.handlers.Callback(frames.append, indirect=False),
                )
                for neighbour, frames in zip(config.neighbour_joints, self.heard, strict=True)
            ),
            *(link.declare_matching_listener(self._left(MATCHING)) for link in self._links),
            alive.declare_subscriber(keys.plant_alive(rig), self._left(PLANT), history=True),
            alive.declare_token(keys.alive(rig, joint, boot)),
        ]

    def say(self, actuation: Actuation) -> None:
        """Send what a tick says."""
        # Neighbours first: their frames travel while the plant waits for the slowest torque.
        for link, payload in zip(self._links, actuation.links, strict=True):
            link.put(payload)
        self._torque.put(actuation.torque)

    def report_stall(self, payload: bytes) -> None:
        """Tell the plant that a neighbour's frame is missing."""
        self._stalled.put(payload)

    def ask(self, request: bytes, timeout_s: float) -> None:
        """Ask the plant to be let in; its answer comes as an event."""
        self.session.get(keys.ENROL, self._left(REPLY), payload=request, timeout=timeout_s)

    def links_up(self) -> list[bool]:
        """For each link, whether what is said on it is heard at the other end."""
        return [self._is_up(link) for link in self._links]

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        while not self.events.empty():
            self.events.get()
        for frames in self.heard:
            frames.clear()

    def _observed(self) -> "zenoh.handlers.Callback[zenoh.Sample]":
        return zenoh.handlers.Callback(self.events.put, indirect=False)

    def _left(self, kind: int) -> "zenoh.handlers.Callback[Any]":
        put = self.events.put
        return zenoh.handlers.Callback(lambda content: put((kind, content)), indirect=False)

    def _publisher(self, key: str) -> zenoh.Publisher:
        return self.session.declare_publisher(
            key,
            express=True,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )

    @staticmethod
    def _is_up(publisher: zenoh.Publisher) -> bool:
        status: Any = publisher.matching_status  # The stub calls it a bool; it is an object.
        return bool(status.matching)
