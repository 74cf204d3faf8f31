"""A recording in which somebody has written anything at all: an answer or a line, no traceback."""

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from deploy.failure import FailedError
from deploy.recording.mcap.file import write_mcap
from deploy.recording.trajectory import recorded_trajectory
from protocol.process.exit_codes import ExitCode
from tests.deploy.commands.test_recordings import typed
from tests.deploy.spools import by_the_wall, spool, timed

pytestmark = pytest.mark.slow

JUNK: tuple[Any, ...] = (
    None,
    -1,
    2**63,
    2**70,
    "x",
    "NaN",
    [],
    {},
    True,
    1.5,
    -0.0,
    [1],
    ["a"],
    [[]],
    "1",
)
REPORTED = 6
"""So many spoiled files are reported as well: drawing takes a second."""
TEXTS = ("resolved", "all")
"""Fields that hold JSON of their own."""


def spoil(chance: Random, where: Any) -> None:
    """Put junk in place of one value, somewhere in an object or list; or leave a name out."""
    key = chance.choice(list(where) if isinstance(where, dict) else range(len(where)))
    value = where[key]
    if isinstance(value, dict | list) and value and chance.random() < 0.7:
        spoil(chance, value)
    elif key in TEXTS and isinstance(value, str) and chance.random() < 0.8:
        inner = {"it": json.loads(value)}
        spoil(chance, inner)
        where[key] = json.dumps(inner.get("it"))
    elif isinstance(where, dict) and chance.random() < 0.1:
        del where[key]
    else:
        where[key] = chance.choice(JUNK)


def spoiled(chance: Random, source: Path, target: Path) -> None:
    with source.open("rb") as old, target.open("wb") as new:
        reader, writer = make_reader(old), Writer(new)
        messages = list(reader.iter_messages(log_time_order=False))
        topic = chance.choice(sorted({channel.topic for _, channel, _ in messages}))
        which = chance.choice([i for i, found in enumerate(messages) if found[1].topic == topic])
        writer.start()
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        numbers: dict[int, int] = {}
        for i, (schema, channel, message) in enumerate(messages):
            assert schema is not None
            if channel.id not in numbers:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.id] = writer.register_channel(channel.topic, "json", number)
            body = json.loads(message.data)
            if i == which:
                spoil(chance, body)
            data = json.dumps(body).encode()
            writer.add_message(numbers[channel.id], message.log_time, data, message.publish_time)
        writer.finish()


@pytest.fixture(scope="module", params=["lockstep", "realtime"])
def source(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    settings = ("event.0.at_s=0.01", "event.1.at_s=0.02", "run.duration_s=0.03")
    lockstep = request.param == "lockstep"
    of = timed(spool("hotplug", *settings)) if lockstep else by_the_wall(*settings)
    path = tmp_path_factory.mktemp("broken") / "run.mcap"
    write_mcap(of, recorded_trajectory(of), path, lambda _tick: None)
    return path


def outcome(*words: str | Path) -> tuple[int, str]:
    """Exit code, and the line that the user is told."""
    try:
        return typed(*words).exit_code, ""
    except FailedError as error:
        return error.code, str(error)


@pytest.mark.parametrize("seed", range(30))
def test_any_value_may_be_junk(tmp_path: Path, source: Path, seed: int) -> None:
    path = tmp_path / "run.mcap"
    spoiled(Random(seed), source, path)
    commands = [("replay",), ("recover",), ("export", "--to", "npz")]
    commands += [("report",)] if seed < REPORTED else []
    for command in commands:
        code, line = outcome(command[0], path, *command[1:])
        assert code in (ExitCode.OK, ExitCode.FAILED, ExitCode.BAD_INPUT)
        assert "\n" not in line
