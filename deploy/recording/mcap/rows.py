"""Messages of `run.mcap` as typed rows, channel by channel: what the report and tables are made of.

Rule 1: a row has the fields that are wanted, and the others of its message are passed over.
Rule 2: a file is believed. What its messages say need not follow from its records; whether it does,
        `decmesh replay` finds out. But a row has the types of its fields, or the file is refused.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec

from deploy.recording.mcap import realtime_schema, schema
from deploy.recording.mcap.contents import DAMAGE, NoRecordingError, Registry, messages, parts
from protocol.wire.timing import Timing

Numbers = list[float]
Integers = list[int]


class ScenarioRow(msgspec.Struct, gc=False):
    """What was run."""

    resolved: str
    """JSON text."""


class FactsRow(msgspec.Struct, gc=False):
    """Where and with what it was run."""

    all: str
    """JSON text."""


class TickRow(msgspec.Struct, gc=False):
    """The body in one tick."""

    tick: int
    angles_rad: Numbers
    rates_rad_s: Numbers
    torques_nm: Numbers


class TorqueRow(msgspec.Struct, gc=False):
    """What a board answered."""

    tick: int
    """When it was said; in realtime it is in force later."""
    torque_nm: float
    state: int
    enabled: int
    controlled_rad: float
    epoch: int
    round: int
    urgency: float
    candidate: int


class LinkRow(msgspec.Struct, gc=False):
    """A link frame, by what became of it."""

    tick: int
    fate: str
    heard_tick: int
    frame_bytes: int


class EpochRow(msgspec.Struct, gc=False):
    """One election."""

    epoch: int
    tick: int
    began_tick: int
    members: list[str]
    w_rad: Numbers
    rounds_to_agreement: int
    known_after_rounds: Integers
    y: Integers


class PlantTimingRow(msgspec.Struct, gc=False):
    """When the plant did what in a tick."""

    tick: int
    opened_ns: int
    answered_ns: Integers
    closed_ns: int


class BoardTickRow(msgspec.Struct, gc=False):
    """When a board did what in a tick."""

    taken_up_us: int
    decided_us: int
    said_us: int
    first_arrived_us: int
    second_arrived_us: int


class BoardTimingRow(msgspec.Struct, gc=False):
    """When a board did what in some ticks on end, and what it has used."""

    incarnation: int
    tick: int
    base_ns: int
    clock: int
    cpu_us: int
    memory_kb: int
    ticks: list[BoardTickRow]


class LinkRefusedRow(msgspec.Struct, gc=False):
    """Frames that a board refused of a neighbour."""

    sender: str
    receiver: str
    reason: str
    frames: int


class NetworkRefusedRow(msgspec.Struct, gc=False):
    """Frames that a board refused though no link model had touched them."""

    joint: str
    reason: str
    frames: int


class RefusedRow(msgspec.Struct, gc=False):
    """Frames that boards refused."""

    by_link: list[LinkRefusedRow]
    by_network: list[NetworkRefusedRow]


class OutcomeRow(msgspec.Struct, gc=False):
    """How the run ended."""

    tick: int
    angles_rad: Numbers
    rates_rad_s: Numbers
    ending: str
    wall_s: float


class TakenRow(msgspec.Struct, gc=False):
    """What a turn was played with of one neighbour."""

    newest_tick: int
    before: int


class TurnRow(msgspec.Struct, gc=False):
    """One turn of a board in realtime."""

    incarnation: int
    slot: int
    woke_us: int
    late_us: int
    busy_us: int
    phase_us: int
    seen_tick: int
    skipped: int
    marks: int
    taken: list[TakenRow]


class PaceRow(msgspec.Struct, gc=False):
    """How the plant kept up with the wall clock."""

    behind_ms_max: float
    slipped_s: float


READ = frozenset(
    {
        schema.SCENARIO.name,
        schema.FACTS.name,
        schema.PLANT_TICK.name,
        schema.TORQUE.name,
        schema.LINK.name,
        schema.EPOCH.name,
        schema.EVENT.name,
        schema.TIMING.name,
        schema.REPORTS[Timing].name,
        schema.REFUSED.name,
        schema.OUTCOME.name,
        realtime_schema.TURN.name,
        realtime_schema.PACE.name,
    }
)
"""Kinds of messages that are read; observations, the largest, and last words are not."""

TICK = schema.PLANT_TICK.name
Row = TypeVar("Row", bound=msgspec.Struct)
Keeper = tuple[Callable[[bytes], None], Callable[[int], None], bool]
"""Keeps a message, and its place, of a channel; and whether it is the plant's ticks."""


class Channels:
    """The messages of a file by their topics."""

    def __init__(self, file: IO[bytes]) -> None:
        self.metadata: dict[str, str] = {}
        self.ticks = 0
        """How many ticks of the plant were told so far."""
        self._registry = Registry(READ)
        self._messages: defaultdict[str, list[bytes]] = defaultdict(list)
        self._places: defaultdict[str, list[int]] = defaultdict(list)
        self._keepers: dict[int, Keeper] = {}
        self._parts = parts(file, self._registry)

    def read(self) -> None:
        """Read the file to its end. Raises one of `DAMAGE`."""
        for part in self._parts:
            if isinstance(part, dict):
                self.metadata = part
                continue
            for number, data in messages(part, self._registry):
                keep, place, is_tick = self._keepers.get(number) or self._keeper(number)
                keep(data)
                place(self.ticks)
                self.ticks += is_tick

    def _keeper(self, number: int) -> Keeper:
        kind, topic = self._registry.channels[number]
        found = self._messages[topic].append, self._places[topic].append, kind == TICK
        self._keepers[number] = found
        return found

    def rows(self, topic: str, kind: type[Row]) -> list[Row]:
        """All messages of a topic. Raises `msgspec.MsgspecError` or ValueError."""
        found = self._messages.get(topic, [])
        # All at once: what is read one by one takes twice as long. Numbers that are none are words.
        rows = msgspec.json.decode(b"[%b]" % b",".join(found), type=list[kind], strict=False)  # type: ignore[valid-type]
        if len(rows) != len(found):
            raise ValueError(f"{len(found)} messages on {topic} say {len(rows)} things")
        return rows

    def tables(self, topic: str) -> list[dict[str, Any]]:
        """All messages of a topic whose fields depend on what they say. Raises as `rows`."""
        return [
            msgspec.json.decode(data, type=dict[str, Any]) for data in self._messages.get(topic, [])
        ]

    def places(self, topic: str) -> Sequence[int]:
        """For each of these rows, how many ticks were told before it."""
        return self._places.get(topic, [])

    def only(self, topic: str, kind: type[Row]) -> Row | None:
        """The last message of a topic; None if there is none."""
        found = self.rows(topic, kind)
        return found[-1] if found else None


def read_channels(path: Path) -> Channels:
    """Read a file of ours. Raises OSError or `NoRecordingError`."""
    with path.open("rb") as file:
        found = Channels(file)
        try:
            found.read()
        except NoRecordingError:
            raise
        except DAMAGE as error:
            left = "decmesh recover reads what" if found.ticks else "nothing of the run"
            raise NoRecordingError(f"it is damaged or cut off; {left} comes before that") from error
    if not found.metadata:
        raise NoRecordingError("it is an MCAP file, but not of decmesh")
    return found


def json_table(text: str) -> dict[str, Any]:
    """A table that stands in a message as JSON text. Raises `msgspec.MsgspecError`."""
    return msgspec.json.decode(text, type=dict[str, Any])
