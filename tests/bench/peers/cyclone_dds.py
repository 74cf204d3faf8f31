"""CycloneDDS: reliable, a topic for each directed pair of roles."""

import os
import time
from collections import deque
from dataclasses import dataclass

from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from tests.bench.job import FRAME_BYTES, LOOK_EVERY_S, Place, partners

LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
    '<Peers><Peer address="localhost"/></Peers></Discovery></Domain></CycloneDDS>'
)
DOMAINS = 100
"""Each job has a domain of its own, by its port."""


@dataclass
class Frame(IdlStruct):
    """64 bytes."""

    content: array[uint8, FRAME_BYTES]


class CycloneDds:
    """A writer to each partner, and a reader with a wait set for each."""

    def __init__(self, place: Place, role: int) -> None:
        os.environ["CYCLONEDDS_URI"] = LOOPBACK
        participant = DomainParticipant(1 + place.port % DOMAINS)
        qos = Qos(Policy.Reliability.Reliable(duration(seconds=10)), Policy.History.KeepAll)
        others = partners(role, place.boards)
        self._writers = {
            other: DataWriter(
                participant, Topic(participant, f"from_{role}_to_{other}", Frame, qos)
            )
            for other in others
        }
        self._inboxes = {
            other: _Inbox(
                participant,
                DataReader(participant, Topic(participant, f"from_{other}_to_{role}", Frame, qos)),
            )
            for other in others
        }
        for other in others:
            while not self._writers[other].get_matched_subscriptions():
                time.sleep(LOOK_EVERY_S)
            while not self._inboxes[other].reader.get_matched_publications():
                time.sleep(LOOK_EVERY_S)

    def put(self, receiver: int, frame: bytes) -> None:
        """Write a sample."""
        self._writers[receiver].write(Frame(frame))

    def get(self, sender: int) -> bytes:
        """Wait for a sample."""
        return self._inboxes[sender].get()

    def close(self) -> None:
        """Wait until everything has been heard; the rest ends with the process."""
        for writer in self._writers.values():
            writer.wait_for_acks(duration(seconds=1))


class _Inbox:
    """Samples of one reader, taken as they come."""

    def __init__(self, participant: DomainParticipant, reader: DataReader[Frame]) -> None:
        self.reader = reader
        self._waiting = WaitSet(participant)
        self._any = ReadCondition(reader, SampleState.Any | ViewState.Any | InstanceState.Any)
        self._waiting.attach(self._any)
        self._heard: deque[Frame] = deque()

    def get(self) -> bytes:
        heard = self._heard
        while not heard:
            heard.extend(self.reader.take(N=8))
            if not heard:
                self._waiting.wait(duration(seconds=10))
        return bytes(heard.popleft().content)


open_endpoint = CycloneDds
