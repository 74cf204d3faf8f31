"""The plant's place on the network: what it declares, and the one queue for what comes.

What comes each tick is left in the queue by a function written in C: a Python function, called from
a thread that Python did not start, costs more than the tick.
"""

from collections import deque
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import zenoh

from protocol.wire import keys
from protocol.wire.frames import REPORTS, Report
from protocol.wire.wiring import Rig

ENROL, ALIVE, CONTROL, STALLED, FAULT, TRACE = range(6)
REPORTS_MAX = 4096
"""Boards say as much in some ten thousand ticks; whoever says more in one loses the oldest."""
Event = tuple[int, Any]
"""A kind, and what the network brought of it."""


class PlantNetwork:
    """Publishers, subscribers and queryables of one plant.

    It listens to boards' reports only if it `records`, and to their traces only `in_realtime`.
    """

    def __init__(
        self,
        session: zenoh.Session,
        rig: Rig,
        joints: list[str],
        *,
        records: bool,
        in_realtime: bool,
    ) -> None:
        self.rig = rig.name
        self._session = session
        self.events: SimpleQueue[zenoh.Sample | Event] = SimpleQueue()
        """Torque frames as they come, everything else with its kind."""
        name = rig.name
        self.torque_keys = {keys.torque(name, joint): i for i, joint in enumerate(joints)}
        """Whose torque frame comes with which key."""
        self._report_keys = {
            keys.report(name, joint, kind): (i, kind)
            for kind in REPORTS
            for i, joint in enumerate(joints)
        }
        self._reports: deque[zenoh.Sample] = deque(maxlen=REPORTS_MAX)
        self._observations = [self._publisher(keys.observation(name, joint)) for joint in joints]
        self._end = self._publisher(keys.end(name))
        alive = session.liveliness()
        put = zenoh.handlers.Callback(self.events.put, indirect=False)
        note = zenoh.handlers.Callback(self._reports.append, indirect=False)
        self._declared = [
            *[session.declare_subscriber(key, put) for key in self.torque_keys],
            *[
                session.declare_subscriber(keys.stalled(name, joint), self._left(STALLED))
                for joint in joints
            ],
            *[session.declare_subscriber(key, note) for key in self._report_keys if records],
            *[
                session.declare_subscriber(keys.fault(name, joint), self._left(FAULT))
                for joint in joints
            ],
            *[
                session.declare_subscriber(keys.trace(name, joint), self._left(TRACE))
                for joint in joints
                if in_realtime
            ],
            session.declare_queryable(keys.ENROL, self._left(ENROL)),
            session.declare_queryable(keys.control(name), self._left(CONTROL)),
            alive.declare_subscriber(keys.any_alive(name), self._left(ALIVE), history=True),
            alive.declare_token(keys.plant_alive(name)),
        ]

    def observe(self, board: int, payload: bytes) -> None:
        """Send a board its observation."""
        self._observations[board].put(payload)

    def reaches(self, board: int) -> bool:
        """Whether an observation would be heard by a process of that board."""
        told: Any = self._observations[board]  # The stub calls its status a bool; it is an object.
        return bool(told.matching_status.matching)

    def reports(self) -> Iterator[tuple[int, type[Report], bytes]]:
        """Boards, and the reports that have come from them since the last look, with their kind."""
        while self._reports:
            sample = self._reports.popleft()
            yield *self._report_keys[str(sample.key_expr)], sample.payload.to_bytes()

    def end(self, payload: bytes) -> None:
        """Tell every board that the run is over."""
        self._end.put(payload)

    def _left(self, kind: int) -> "zenoh.handlers.Callback[Any]":
        put = self.events.put
        return zenoh.handlers.Callback(lambda content: put((kind, content)), indirect=False)

    def _publisher(self, key: str) -> zenoh.Publisher:
        return self._session.declare_publisher(
            key,
            express=True,
            priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )
