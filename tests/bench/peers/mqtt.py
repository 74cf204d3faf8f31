"""MQTT through a mosquitto broker: quality of service 0, a topic for each directed pair."""

import select
import socket
import time
from collections import deque
from typing import Any

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from tests.bench.job import LOOK_EVERY_S, Place, partners


class Mqtt:
    """One thread: it reads what comes until the frame is there that it waits for."""

    def __init__(self, place: Place, role: int) -> None:
        others = partners(role, place.boards)
        self._heard: dict[str, deque[bytes]] = {f"{other}/{role}": deque() for other in others}
        self._from = {other: self._heard[f"{other}/{role}"] for other in others}
        self._topics = {other: f"{role}/{other}" for other in others}
        self._subscribed = 0
        client = self._client = Client(CallbackAPIVersion.VERSION2, client_id=str(role))
        client.on_message = self._hear
        client.on_subscribe = self._count
        while True:
            try:
                client.connect("127.0.0.1", place.port, keepalive=600)
            except ConnectionRefusedError:
                time.sleep(LOOK_EVERY_S)
            else:
                break
        link = client.socket()
        assert link is not None
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._link = link
        while not client.is_connected():
            self._read()
        for topic in self._heard:
            client.subscribe(topic)
        while self._subscribed < len(self._heard):
            self._read()

    def put(self, receiver: int, frame: bytes) -> None:
        """Publish a frame."""
        self._client.publish(self._topics[receiver], frame)

    def get(self, sender: int) -> bytes:
        """Wait for a frame."""
        heard = self._from[sender]
        while not heard:
            self._read()
        return heard.popleft()

    def close(self) -> None:
        """Say goodbye to the broker."""
        self._client.disconnect()

    def _read(self) -> None:
        select.select([self._link], [], [], 1.0)
        self._client.loop_read()
        if self._client.want_write():
            self._client.loop_write()

    def _hear(self, _client: Client, _user: Any, message: MQTTMessage) -> None:
        self._heard[message.topic].append(message.payload)

    def _count(self, *_about: Any) -> None:
        self._subscribed += 1


open_endpoint = Mqtt
