"""Whoever reads events is shown every member of the vocabulary, made from its type.

mypy names a reader that leaves one out; here each is called with all of them.
"""

import ast
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path
from zlib import decompress

import msgpack
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from deploy.launch.twin import Twin
from deploy.outcome.summary import summary
from deploy.recording.mcap import bodies, schema
from deploy.recording.mcap.file import dump
from deploy.recording.replay import Replay
from deploy.recording.trajectory import Trajectory
from deploy.report.sections.happenings import timeline, told
from deploy.report.words import Wording
from plant_server.session.control import answer
from plant_server.session.record import COMPLETE, Outcome, TickRecord
from plant_server.spool.spool import SpoolWriter, read_spool
from protocol.robot.events import COMMANDS, EVENTS, Consequence, Excuse, check_event, values_of
from protocol.robot.scenario import Scenario
from protocol.wire.frames import FRAME_BYTES_MAX, VERSION, seal
from tests.deploy.recordings import run
from tests.protocol.events_drawn import of_kind

LAW = settings(
    max_examples=10,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
EVERY = pytest.mark.parametrize("tag", EVENTS)
ROOT = Path(__file__).parents[2]


@cache
def short() -> Trajectory:
    return run("paper", "run.duration_s=0.1")


def scenario() -> Scenario:
    return short().scenario


@EVERY
@LAW
@given(data=st.data())
def test_every_event_has_words_and_a_place_in_the_summary(tag: str, data: st.DataObject) -> None:
    event = data.draw(of_kind(EVENTS[tag], 3))
    check_event(event, scenario().joints)
    trajectory = replace(short(), events=[(7, event)])
    words = Wording(scenario()).event(event)
    assert words
    assert [found.words for found in told(trajectory)] == [words]
    timeline(trajectory)
    failed = summary(trajectory, mode="twin")["faults"]
    assert bool(failed) == (tag == "fault")


@EVERY
@LAW
@given(data=st.data())
def test_every_event_comes_back_from_spool_and_mcap(
    tag: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    event = data.draw(of_kind(EVENTS[tag], 3))
    path = tmp_path_factory.mktemp("spool") / "run.spool"
    state = ((0.0,) * 3,) * 2
    with SpoolWriter(path, scenario()) as writer:
        record = TickRecord(0, *state, (0.0,) * 3, (b"",) * 3, (event,))
        writer.append(record, None)
        writer.close(Outcome(1, *state, COMPLETE, 0.0))
    assert read_spool(path).ticks == [record]
    body = bodies.of_event(0, event)
    assert set(body) <= set(schema.EVENT.fields)
    assert bodies.to_event(json.loads(dump(body))) == event


@pytest.mark.parametrize("tag", COMMANDS)
@LAW
@given(data=st.data())
def test_every_command_of_a_terminal_is_carried_out_or_refused(
    tag: str, data: st.DataObject
) -> None:
    """Everybody is there, and not every board has every sensor."""
    event = data.draw(of_kind(EVENTS[tag], 3))
    twin = Twin(scenario())
    request = seal(msgpack.packb((VERSION, json.dumps(values_of(event)))))
    assume(len(request) <= FRAME_BYTES_MAX)
    reply = json.loads(decompress(answer(twin.lockstep, scenario().joints, request)))
    happened = [*twin.tick().events, *twin.tick().events]
    if tag == "plug":
        assert "is plugged in already" in reply["refused"]
    elif "refused" in reply:
        assert tag == "sensor"
        assert " has no " in reply["refused"]
    else:
        assert event in happened


@EVERY
@LAW
@given(data=st.data())
def test_a_replay_carries_out_every_event_but_those_that_follow(
    tag: str, data: st.DataObject
) -> None:
    event = data.draw(of_kind(EVENTS[tag], 3))
    first, second = islice(Twin(scenario()).run(), 2)
    replay = Replay(scenario())
    replay.play(first)
    played = replay.play(second._replace(events=(event,))).record
    if isinstance(event, Consequence | Excuse):
        return  # Nobody is excused a frame of a board that is no neighbour.
    assert event in played.events


def names(node: ast.AST) -> set[str]:
    """Classes that the patterns of a `match` name."""
    return {
        inner.cls.id
        for inner in ast.walk(node)
        if isinstance(inner, ast.MatchClass) and isinstance(inner.cls, ast.Name)
    }


def incomplete(tree: ast.AST) -> Iterator[str]:
    """Every `match` on events that does not end in `assert_never`.

    One on what `begin` returns has two cases, for who is at the plug.
    """
    for node in ast.walk(tree):
        if not isinstance(node, ast.Match) or ast.unparse(node.subject).endswith(".begin()"):
            continue
        last = ast.unparse(node.cases[-1])
        if names(node) & MEMBERS and "assert_never" not in last:
            yield ast.unparse(node.subject)


MEMBERS = {kind.__name__ for kind in EVENTS.values()}


def test_every_match_on_events_ends_in_assert_never() -> None:
    packages = ("protocol", "module_agent", "plant_server", "deploy")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    trees = {path.name: ast.parse(path.read_text(encoding="utf-8")) for path in files}
    found = {name: list(incomplete(tree)) for name, tree in trees.items()}
    assert {name: subjects for name, subjects in found.items() if subjects} == {}
    assert sum(bool(names(tree) & MEMBERS) for tree in trees.values()) >= 5, "it looks at readers"


def test_a_match_that_lets_others_pass_would_be_found() -> None:
    code = "match event:\n    case Push():\n        pass\n    case _:\n        pass"
    assert list(incomplete(ast.parse(code))) == ["event"]
