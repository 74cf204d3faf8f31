"""Events: one vocabulary, read back as it was written; what is not in it is refused, and says why.

Values are drawn from the types themselves, so a new member is under all of these laws at once.
"""

from contextlib import suppress
from math import inf, nan
from typing import Any, get_args

import msgpack
import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.robot.events import (
    ANY,
    COMMANDS,
    EVENTS,
    PERFECT,
    WHEN,
    BetweenTicks,
    BoardCommand,
    Command,
    Consequence,
    Event,
    EventError,
    LinkChange,
    LinkOrder,
    LinkParameters,
    LinkRepair,
    Midway,
    ReferenceOrder,
    changed,
    check_event,
    command_of,
    concerns,
    decode_board_command,
    encode_board_command,
    event_of,
    meaning_of,
    tag_of,
    values_of,
)
from protocol.robot.sensors import Readings
from protocol.wire.frames import (
    FRAME_BYTES_MAX,
    NO_TICK,
    Neighbour,
    Observation,
    decode,
    encode,
)
from tests.protocol.events_drawn import ALL, BOARD_COMMANDS, annotated_fields

LAW = settings(max_examples=200, deadline=None, derandomize=True)
JOINTS = ["ankle", "knee", "hip"]


@LAW
@given(ALL)
def test_every_event_is_read_back_as_it_was_written(event: Event) -> None:
    """As values, as JSON and as msgpack."""
    assert event_of(values_of(event)) == event
    for codec in (msgspec.json, msgspec.msgpack):
        written = codec.encode(event)
        assert event_of(codec.decode(written)) == event
    assert msgpack.unpackb(msgpack.packb(event, default=values_of))[0] == tag_of(event)


def test_every_event_says_when_it_comes_and_of_each_field_what_it_means() -> None:
    assert set(WHEN) == set(EVENTS.values())
    members = [*get_args(BetweenTicks), *get_args(Midway), *get_args(Consequence)]
    assert len(members) == len(set(members)) == len(EVENTS), "tags and times are of one event each"
    assert set(COMMANDS.values()) == set(get_args(Command))
    for kind in members:
        assert kind.__doc__, kind
        for hint in annotated_fields(kind).values():
            assert meaning_of(hint), kind


@LAW
@given(ALL)
def test_no_value_beyond_its_bounds_is_read(event: Event) -> None:
    """Of each number one less than the least and one more than the most; neither NaN."""
    tag, *values = values_of(event)
    for at, hint in enumerate(annotated_fields(type(event)).values()):
        for meta in hint.__metadata__:
            beyond = [meta.ge - 1] if meta.ge is not None else []
            beyond += [meta.le + 1] if meta.le is not None else []
            beyond += [meta.lt] if meta.lt is not None else []
            beyond += [nan, inf] if beyond and isinstance(values[at], float) else []
            for value in beyond:
                other = [*values]
                other[at] = value
                with pytest.raises(EventError, match=tag):
                    event_of([tag, *other])


@pytest.mark.parametrize("tag", EVENTS)
def test_an_event_with_a_field_too_few_or_too_many_is_refused(tag: str) -> None:
    fields = EVENTS[tag].__struct_fields__
    for values in ([0] * (len(fields) - 1), [0] * (len(fields) + 1)):
        with pytest.raises(EventError, match=tag):
            event_of([tag, *values])


@pytest.mark.parametrize("tag", [tag for tag in EVENTS if tag not in COMMANDS])
def test_what_only_the_plant_says_is_no_command(tag: str) -> None:
    with pytest.raises(EventError, match=f"there is no '{tag}'; there are link, heal"):
        command_of([tag, 1])


GOOD: list[list[Any]] = [
    ["link", [], {"loss": 0.2}],
    ["link", [[0, 1]], {"loss": 0, "cut": 1, "delay_ticks": 31, "jitter_ticks": 31.0}],
    ["link", [[0, 1], [1, 0], [2, 1]], dict.fromkeys(LinkParameters._fields, 0.0)],
    ["heal", []],
    ["heal", [[2, 1]]],
    ["reference", 2, -0.1],
    ["push", 0, -40.0, 100],
    ["sensor", 1, "encoder", "stuck", 0.0, 500],
    ["sensor", 1, "all", "ok", 0, 0],
    ["sensor", 2, "imu", "delayed", 30.0, 0],
    ["sensor", 2, "imu", "intermittent", 0.5, 0],
    ["unplug", 0],
    ["plug", 2],
]

IMPOSSIBLE: list[tuple[Any, str]] = [
    ([], "not [what, ...]"),
    (None, "not [what, ...]"),
    ({}, "not [what, ...]"),
    ("unplug", "not [what, ...]"),
    ([["unplug"], 1], "not [what, ...]"),
    (["dance"], "there is no 'dance'; there are link, heal"),
    (["x" * 400], "there is no 'xxx"),
    (["unplug"], "unplug: expected array of at least length 2"),
    (["unplug", "knee"], "unplug: board: expected int, got str"),
    (["unplug", 1, 2], "unplug: expected array of at most length"),
    (["unplug", 3], "there is no board 3; the body has ankle, knee, hip"),
    (["plug", -1], "plug: board: expected int >= 0"),
    (["plug", True], "plug: board: expected int, got bool"),
    (["link", [[0, 2]], {"loss": 0.1}], "ankle and hip have no link"),
    (["link", [[1, 1]], {"loss": 0.1}], "knee and knee have no link"),
    (["link", [[0, 3]], {"loss": 0.1}], "there is no board 3"),
    (["link", [[True, False]], {"loss": 0.1}], "link: pairs: expected int, got bool"),
    (["link", [[0]], {"loss": 0.1}], "link: pairs: expected array of length 2"),
    (["link", [0, 1], {"loss": 0.1}], "link: pairs: expected array, got int"),
    (["link", "all", {"loss": 0.1}], "link: pairs: expected array, got str"),
    (["link", [], {}], "link: changes: expected object of length >= 1"),
    (["link", [], {"lose": 0.1}], "a link has no 'lose'; it has loss, burst_start"),
    (["link", [], {"loss": "0.1"}], "link: changes: expected float, got str"),
    (["link", [], {"loss": True}], "link: changes: expected float, got bool"),
    *((["link", [], {"loss": value}], "link: loss: expected float") for value in (-0.1, 1.1, nan)),
    (["link", [], {"cut": 0.5}], "link: cut: expected float that's a multiple of 1"),
    (["link", [], {"delay_ticks": 1.5}], "link: delay_ticks: expected float that's a multiple"),
    *(
        (["link", [], {"jitter_ticks": value}], "link: jitter_ticks: expected float")
        for value in (-1, 32, inf, nan)
    ),
    (["heal", [[2, 0]]], "hip and ankle have no link"),
    (["reference", 3, 0.0], "there is no board 3"),
    (["reference", 0, "5deg"], "reference: reference_rad: expected float, got str"),
    *((["reference", 0, value], "reference_rad: expected float") for value in (3.3, -3.3, nan)),
    (["push", 3, 40.0, 10], "there is no board 3"),
    *((["push", 0, 1.0, ticks], "push: ticks: expected int") for ticks in (0, -1, 10**8, True)),
    (["push", 0, 1.0, 1.5], "push: ticks: expected int, got float"),
    (["sensor", 3, "encoder", "off", 0.0, 0], "there is no board 3"),
    (["sensor", 0, "nose", "off", 0.0, 0], "invalid enum value 'nose'; there are encoder, gyro"),
    (["sensor", 0, "x" * 400, "off", 0.0, 0], "sensor: invalid enum value 'xxx"),
    (["sensor", 0, "imu", "drunk", 0.0, 0], "invalid enum value 'drunk'; there are ok, off"),
    (["sensor", 0, "imu", "stuck", 1.0, 0], "stuck takes no amount"),
    (["sensor", 0, "imu", "stuck", nan, 0], "stuck takes no amount"),
    *(
        (["sensor", 0, "imu", fault, amount, 0], f"{fault} takes 1 to 10000 whole ticks")
        for fault in ("slow", "delayed")
        for amount in (0.0, -1.0, 1.5, 1e9, nan, inf)
    ),
    *(
        (["sensor", 0, "imu", "intermittent", amount, 0], "intermittent takes a probability")
        for amount in (-0.1, 1.1, nan)
    ),
    *((["sensor", 0, "imu", "off", 0.0, ticks], "ticks: expected int") for ticks in (-1, 10**8)),
]


@pytest.mark.parametrize("values", GOOD, ids=str)
def test_what_can_be_done_is_accepted(values: list[Any]) -> None:
    check_event(command_of(values), JOINTS)


@pytest.mark.parametrize(("values", "why"), IMPOSSIBLE, ids=str)
def test_what_cannot_be_done_is_refused_with_its_reason(values: Any, why: str) -> None:
    with pytest.raises(EventError) as refused:
        check_event(command_of(values), JOINTS)
    assert why in str(refused.value)
    assert len(str(refused.value)) < 200
    assert "\n" not in str(refused.value)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(LinkParameters._fields) | st.text(max_size=3), inner)
    ),
    max_leaves=6,
)


@LAW
@given(st.builds(lambda t, rest: [t, *rest], st.sampled_from([*EVENTS]), st.lists(JSON)) | JSON)
def test_whatever_comes_is_accepted_or_refused_and_nothing_else_happens(values: Any) -> None:
    with suppress(EventError):
        check_event(event_of(values), JOINTS)
    with suppress(EventError):
        check_event(event_of(values, strict=False), JOINTS)


@LAW
@given(BOARD_COMMANDS)
def test_what_a_board_is_to_obey_reaches_it_as_it_was(command: BoardCommand) -> None:
    assert decode_board_command(encode_board_command(command)) == command


@LAW
@given(st.dictionaries(st.sampled_from(LinkParameters._fields), st.sampled_from([0, 1, 1.0])))
def test_what_is_accepted_a_board_can_read(changes: dict[str, float]) -> None:
    """Whole numbers of a JSON command become floats on the way."""
    if changes:
        check_event(LinkChange((), changes), JOINTS)
    command = LinkOrder(0, changed(PERFECT, changes))
    assert decode_board_command(encode_board_command(command)) == command


@LAW
@given(st.binary(max_size=120))
def test_random_bytes_are_no_command(payload: bytes) -> None:
    decoded = decode_board_command(payload)
    assert decoded is None or isinstance(decoded, BoardCommand)


def _link(**changes: Any) -> list[Any]:
    return [1, 0, PERFECT._replace(**changes)]


@pytest.mark.parametrize(
    "fields",
    [
        1,
        "abc",
        {},
        [],
        [2],
        [2, nan],
        [2, inf],
        [2, 3.3],
        [2, 0.1, 0.1],
        [2, "0.1"],
        [2.5, 0.1],
        [True, 0, PERFECT],
        [3, 0.1],
        [None, 0.1],
        [[2], 0.1],
        [1, 0, 0.1],
        [1, 0, [*PERFECT, 0.0]],
        [1, 0, PERFECT[:-1]],
        [1, ANY - 1, PERFECT],
        [1, 0.5, PERFECT],
        [1, 0, *PERFECT],
        _link(loss=nan),
        _link(loss=-0.1),
        _link(loss=1.1),
        _link(cut=0.5),
        _link(delay_ticks=32.0),  # What a tick heard would not fit into one number.
        _link(delay_ticks=1e9),
        _link(jitter_ticks=0.5),
        _link(jitter_ticks=inf),
        _link(loss=True),
    ],
    ids=str,
)
def test_what_no_board_can_obey_is_no_command(fields: Any) -> None:
    assert decode_board_command(msgpack.packb(fields)) is None


@pytest.mark.parametrize(
    "payload",
    [
        b"\xc1",
        b"\x91" * 100,
        b"\xdd\xff\xff\xff\xff",
        encode_board_command(ReferenceOrder(0.1))[:-1],
        encode_board_command(ReferenceOrder(0.1)) + b"\x01",
    ],
    ids=bytes.hex,
)
def test_hostile_bytes_are_no_command(payload: bytes) -> None:
    assert decode_board_command(payload) is None


def test_an_observation_with_the_longest_command_fits_a_frame() -> None:
    command = encode_board_command(LinkOrder(1999, PERFECT))
    longest = 2**64 - 1
    readings = Readings(*(1e-300,) * len(Readings._fields))
    observation = Observation(
        longest, longest, longest, readings, command, (Neighbour(*(longest,) * 3),) * 2
    )
    payload = encode(observation)
    assert len(payload) <= FRAME_BYTES_MAX
    assert decode(Observation, payload) == observation
    ordinary = observation._replace(neighbours=(Neighbour(1, NO_TICK, 1),) * 2)
    assert len(encode(ordinary)) < len(payload)


def test_a_command_concerns_the_links_it_names_or_all() -> None:
    assert concerns(LinkRepair(()), 0, 1)
    assert concerns(LinkChange(((0, 1),), {"cut": 1.0}), 0, 1)
    assert not concerns(LinkChange(((0, 1),), {"cut": 1.0}), 1, 0)
