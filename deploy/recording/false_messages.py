"""Whether an MCAP file says what follows from its own records: observations, link frames, epochs.

Rule 1: all of its messages are made again from the records that were read from it, and compared on
        each channel in their order. A channel that somebody has left out of the file is no
        difference.
Rule 2: so is what its metadata say of it, which the report shows.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

import orjson

from deploy.recording.differences import NOTHING, Difference
from deploy.recording.mcap.contents import Content, Metadata, contents
from deploy.recording.mcap.file import description, dump
from deploy.recording.mcap.messages import RecordingMessages
from deploy.recording.trajectory import recorded_trajectory
from plant_server.spool.spool import Spool


class _Expected(NamedTuple):
    """A message as it should be."""

    tick: int
    data: bytes


class _ExpectedMessages:
    """Messages as they should be, made as they are asked for."""

    def __init__(self, telling: RecordingMessages, on_tick: Callable[[int], None]) -> None:
        self._messages = telling.messages(on_tick)
        self._by_topic: dict[str, deque[_Expected]] = defaultdict(deque)

    def next_on(self, topic: str) -> _Expected | None:
        """The next one on a channel."""
        waiting = self._by_topic[topic]
        while not waiting:
            message = next(self._messages, None)
            if message is None:
                return None
            self._by_topic[message.topic].append(_Expected(message.tick, dump(message.body)))
        return waiting.popleft()


def first_false_message(
    spool: Spool, path: Path, on_tick: Callable[[int], None]
) -> Difference | None:
    """Compare the messages of a file with those that its records, `spool`, give.

    The replay of those must be known to be identical.
    """
    made = _ExpectedMessages(RecordingMessages(spool, recorded_trajectory(spool)), on_tick)
    with path.open("rb") as file:
        return _first(spool, made, file)


def _first(spool: Spool, made: _ExpectedMessages, file: IO[bytes]) -> Difference | None:
    topics = set()
    for content in contents(file):
        if isinstance(content, dict):
            about = next(_false_metadata(content, description(spool)), None)
            if about is not None:
                return Difference(spool.ticks[0].tick, *about)
        else:
            expected = made.next_on(content.topic)
            if expected is None:
                return Difference(spool.ticks[-1].tick, content.topic, content.data, NOTHING)
            if expected.data != content.data:
                found = _difference(content, expected)
                if found is not None:
                    return found
            topics.add(content.topic)
    left = ((topic, made.next_on(topic)) for topic in sorted(topics))
    return next(
        (Difference(one.tick, topic, NOTHING, one.data) for topic, one in left if one), None
    )


def _false_metadata(recorded: Metadata, made: Metadata) -> Iterator[tuple[str, str, str]]:
    """What is false, as it is in the file, and as it should be."""
    for name, value in made.items():
        said = recorded.get(name, NOTHING)
        if said != value:
            yield f"{name} in the metadata", said, value


def _difference(content: Content, expected: _Expected) -> Difference | None:
    recorded, made = orjson.loads(content.data), orjson.loads(expected.data)
    for name in {**recorded, **made}:
        past, now = recorded.get(name, NOTHING), made.get(name, NOTHING)
        if _text(past) != _text(now):
            return Difference(expected.tick, f"{name} on {content.topic}", past, now)
    return None  # Written by another hand: spaces, order.


def _text(value: Any) -> bytes:
    """To the bit, whatever the order of names in an object."""
    return orjson.dumps(value, option=orjson.OPT_SORT_KEYS)
