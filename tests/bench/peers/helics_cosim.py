"""HELICS: message federates under one broker; the plant steps at even times, the boards at odd."""

from collections import deque

import helics as h

from tests.bench.job import PLANT, Place, partners

PERIOD = 2.0
"""What is said at one time is heard at the next, so a tick takes two."""


class Helics:
    """A federate with an endpoint for each partner; to wait is to ask for the next time."""

    def __init__(self, place: Place, role: int) -> None:
        about = h.helicsCreateFederateInfo()
        h.helicsFederateInfoSetCoreTypeFromString(about, "zmq")
        broker = f"--federates=1 --broker_address=tcp://127.0.0.1 --brokerport={place.port}"
        h.helicsFederateInfoSetCoreInitString(about, broker)
        h.helicsFederateInfoSetTimeProperty(about, h.HELICS_PROPERTY_TIME_PERIOD, PERIOD)
        offset = 0.0 if role == PLANT else PERIOD / 2.0
        h.helicsFederateInfoSetTimeProperty(about, h.HELICS_PROPERTY_TIME_OFFSET, offset)
        self._federate = h.helicsCreateMessageFederate(f"role_{role}", about)
        others = partners(role, place.boards)
        self._ends = {
            other: h.helicsFederateRegisterGlobalEndpoint(self._federate, f"{role}/{other}", "")
            for other in others
        }
        for other, end in self._ends.items():
            h.helicsEndpointSetDefaultDestination(end, f"{other}/{role}")
        self._heard: dict[int, deque[bytes]] = {other: deque() for other in others}
        h.helicsFederateEnterExecutingMode(self._federate)

    def put(self, receiver: int, frame: bytes) -> None:
        """Send a message."""
        h.helicsEndpointSendBytes(self._ends[receiver], frame)

    def get(self, sender: int) -> bytes:
        """Wait for a message: until the time at which it comes is granted."""
        heard = self._heard[sender]
        while not heard:
            h.helicsFederateRequestNextStep(self._federate)
            for other, end in self._ends.items():
                while h.helicsEndpointHasMessage(end):
                    message = h.helicsEndpointGetMessage(end)
                    self._heard[other].append(h.helicsMessageGetBytes(message))
        return heard.popleft()

    def close(self) -> None:
        """Leave the federation, so that nobody waits for this one's time."""
        h.helicsFederateDisconnect(self._federate)
        h.helicsCloseLibrary()


open_endpoint = Helics
