"""A board's place on the network: what it declares, and where it leaves what comes.

What comes each tick is left by a function written in C: a Python function, called from a thread
that Python did not start, costs more than the tick. Observations go through `SimpleQueue.put`.
Frames of neighbours are looked up in a dictionary that gives each key that it has not seen, and so
each frame that comes, a reading of the clock: they are kept in order, with their times of arrival.
"""

import time
from collections import defaultdict
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any, Protocol

import zenoh

from module_agent.firmware.board import Actuation
from module_agent.firmware.config import BoardConfig
from protocol.wire import keys
from protocol.wire.frames import REPORTS, Report
from protocol.wire.timing import Timing

END, PLANT, REPLY, MATCHING = range(4)
Event = tuple[int, Any]
"""A kind, and what the network brought of it."""


class Inbox(Protocol):
    """Where observations and link frames are left for the loop of a board."""

    events: "SimpleQueue[zenoh.Sample | Event]"
    """Everything else, each with its kind."""

    def observation_handler(self) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves an observation."""
        ...

    def frame_handler(self, link: int) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves a frame of a neighbour."""
        ...

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        ...


class LockstepInbox:
    """An inbox whose observations wake the loop; link frames wake nobody."""

    def __init__(self, links: int) -> None:
        self.events: SimpleQueue[zenoh.Sample | Event] = SimpleQueue()
        """Observations as they come, everything else with its kind."""
        self._frames = [defaultdict[zenoh.Sample, int](time.monotonic_ns) for _ in range(links)]
        """Of each neighbour. Without an observation they are no use."""

    def observation_handler(self) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves an observation."""
        return zenoh.handlers.Callback(self.events.put, indirect=False)

    def frame_handler(self, link: int) -> "zenoh.handlers.Callback[zenoh.Sample]":
        """What leaves a frame of a neighbour, with its time of arrival."""
        return zenoh.handlers.Callback(self._frames[link].__getitem__, indirect=False)

    def heard(self) -> Iterator[tuple[int, bytes, int]]:
        """What neighbours have said since the last look: link, frame, time of arrival in ns."""
        for link, frames in enumerate(self._frames):
            if frames:
                for sample in list(frames):  # At one go: more may come at any time.
                    yield link, sample.payload.to_bytes(), frames.pop(sample)

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        while not self.events.empty():
            self.events.get()
        for frames in self._frames:
            frames.clear()


class BoardNetwork:
    """Publishers and subscribers of one board."""

    def __init__(
        self, session: zenoh.Session, inbox: Inbox, config: BoardConfig, *, rig: str, boot: int
    ) -> None:
        self.session = session
        self.boot = boot
        """Names this start of the firmware."""
        self.inbox = inbox
        self._neighbours = config.neighbour_joints
        joint, alive = config.joint, session.liveliness()
        self._torque = publisher(session, keys.torque(rig, joint))
        self._stalled = publisher(session, keys.stalled(rig, joint))
        self._reports: dict[type, zenoh.Publisher] = {
            kind: publisher(session, keys.report(rig, joint, kind)) for kind in REPORTS
        }
        self._fault = publisher(session, keys.fault(rig, joint))
        self._trace = publisher(session, keys.trace(rig, joint)) if config.cadence else None
        self._links = [
            publisher(session, keys.link(rig, joint, neighbour))
            for neighbour in config.neighbour_joints
        ]
        self._declared = [
            session.declare_subscriber(keys.observation(rig, joint), inbox.observation_handler()),
            session.declare_subscriber(keys.end(rig), self._left(END)),
            *[
                session.declare_subscriber(
                    keys.link(rig, neighbour, joint), inbox.frame_handler(link)
                )
                for link, neighbour in enumerate(config.neighbour_joints)
            ],
            *[link.declare_matching_listener(self._left(MATCHING)) for link in self._links],
            alive.declare_subscriber(keys.plant_alive(rig), self._left(PLANT), history=True),
            alive.declare_token(keys.alive(rig, joint, self.boot)),
        ]

    def say(self, actuation: Actuation) -> None:
        """Send what a tick says."""
        # Neighbours first: their frames travel while the plant waits for the slowest torque.
        for link, payload in zip(self._links, actuation.links, strict=True):
            link.put(payload)
        for payload in actuation.faults:
            self._fault.put(payload)  # Before the torque, so that the tick is still open.
        self._torque.put(actuation.torque)

    def report_trace(self, payload: bytes | None) -> None:
        """Tell the plant what a board on its own clock has gone through, if there is a frame."""
        if payload is not None:
            assert self._trace is not None, "in lockstep there is nothing to tell"
            self._trace.put(payload)

    def report(self, kind: type[Report], payload: bytes) -> None:
        """Tell the plant what is for the recording alone."""
        self._reports[kind].put(payload)

    @property
    def records(self) -> bool:
        """Whether a plant wants to have reports of this board."""
        return is_up(self._reports[Timing])

    def report_stall(self, payload: bytes) -> None:
        """Tell the plant that a neighbour's frame is missing."""
        self._stalled.put(payload)

    def ask(self, request: bytes, timeout_s: float) -> None:
        """Ask the plant to be let in; its answer comes as an event."""
        self.session.get(keys.ENROL, self._left(REPLY), payload=request, timeout=timeout_s)

    def links_down(self) -> list[str]:
        """Neighbours that would not hear what is said to them."""
        links = zip(self._neighbours, self.links_up(), strict=True)
        return [joint for joint, up in links if not up]

    def links_up(self) -> list[bool]:
        """For each link, whether what is said on it is heard at the other end."""
        return [is_up(link) for link in self._links]

    def forget(self) -> None:
        """Throw away what has come and was not looked at."""
        self.inbox.forget()

    def _left(self, kind: int) -> "zenoh.handlers.Callback[Any]":
        put = self.inbox.events.put
        return zenoh.handlers.Callback(lambda content: put((kind, content)), indirect=False)


def publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    """Declare what a board says every tick: at once, before anything else, and never dropped."""
    return session.declare_publisher(
        key,
        express=True,
        priority=zenoh.Priority.REAL_TIME,
        congestion_control=zenoh.CongestionControl.BLOCK,
    )


def is_up(link: zenoh.Publisher) -> bool:
    """Whether what is said on a link is heard at its other end."""
    told: Any = link  # The stub calls its status a bool; it is an object.
    return bool(told.matching_status.matching)
