"""Commands: what cannot be done is refused with a reason, and a board obeys only what can."""

from contextlib import suppress
from math import inf, nan
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.robot.commands import (
    ANY,
    DELAY_TICKS_MAX,
    LINK,
    PERFECT,
    REFERENCE,
    BoardCommand,
    CommandError,
    LinkParameters,
    changed,
    check_command,
    concerns,
    decode_board_command,
    encode_board_command,
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

LAW = settings(max_examples=200, deadline=None, derandomize=True)
JOINTS = ["ankle", "knee", "hip"]

GOOD: list[list[Any]] = [
    ["link", [], {"loss": 0.2}],
    ["link", [[0, 1]], {"loss": 0, "cut": 1, "delay_ticks": 31, "jitter_ticks": 31.0}],
    ["link", [[0, 1], [1, 0], [2, 1]], dict.fromkeys(LinkParameters._fields, 0.0)],
    ["heal", []],
    ["heal", [[2, 1]]],
    ["reference", 2, -0.1],
    ["push", 0, -40.0, 100],
    ["sensor", 1, "encoder", "stuck", 0.0, 500],
    ["sensor", 1, "all", "ok", 0.0, 0],
    ["sensor", 2, "imu", "delayed", 30.0, 0],
    ["sensor", 2, "imu", "intermittent", 0.5, 0],
    ["unplug", 0],
    ["plug", 2],
]

IMPOSSIBLE: list[tuple[Any, str]] = [
    ([], "not a command"),
    (None, "not a command"),
    ({}, "not a command"),
    ("unplug", "not a command"),
    (["dance"], "not a command"),
    (["unplug"], "not a command"),
    (["unplug", "knee"], "not a command"),
    (["unplug", 1, 2], "not a command"),
    (["unplug", 3], "there is no board 3; the body has ankle, knee, hip"),
    (["plug", -1], "there is no board -1"),
    (["plug", True], "there is no board True"),
    (["link", [[0, 2]], {"loss": 0.1}], "ankle and hip have no link"),
    (["link", [[1, 1]], {"loss": 0.1}], "knee and knee have no link"),
    (["link", [[0, 3]], {"loss": 0.1}], "there is no board 3"),
    (["link", [[True, False]], {"loss": 0.1}], "there is no board True"),
    (["link", [[0]], {"loss": 0.1}], "not a link"),
    (["link", [0, 1], {"loss": 0.1}], "not a link"),
    (["link", [["ankle", "knee"]], {"loss": 0.1}], "not a link"),
    (["link", "all", {"loss": 0.1}], "not a command"),
    (["link", [], {}], "no parameter"),
    (["link", [], {"lose": 0.1}], "a link has no 'lose'; it has loss, burst_start"),
    (["link", [], {"loss": "0.1"}], "loss must be a number"),
    (["link", [], {"loss": True}], "loss must be a number"),
    (["link", [], {"loss": None}], "loss must be a number"),
    *((["link", [], {"loss": value}], "loss must be from 0 to 1") for value in (-0.1, 1.1, nan)),
    (["link", [], {"cut": 0.5}], "cut must be whole and from 0 to 1"),
    (["link", [], {"delay_ticks": 1.5}], "delay_ticks must be whole and from 0 to 31"),
    *(
        (["link", [], {"jitter_ticks": value}], "jitter_ticks must be whole and from 0 to 31")
        for value in (-1, 32, 10**400, inf, nan)
    ),
    (["heal", [[2, 0]]], "hip and ankle have no link"),
    (["reference", 3, 0.0], "there is no board 3"),
    (["reference", 0, "5deg"], "not a command"),
    *((["reference", 0, value], "is beyond 183°") for value in (3.3, -3.3, nan, inf)),
    (["push", 3, 40.0, 10], "there is no board 3"),
    *((["push", 0, value, 10], "is beyond 10000 N") for value in (1.1e4, -1.1e4, nan, -inf)),
    *((["push", 0, 1.0, ticks], "a push lasts 1 to") for ticks in (0, -1, 10**8, True)),
    (["push", 0, 1.0, 1.5], "not a command"),
    (["sensor", 3, "encoder", "off", 0.0, 0], "there is no board 3"),
    (["sensor", 0, "nose", "off", 0.0, 0], "no sensor is called 'nose'; there are encoder"),
    (["sensor", 0, "x" * 400, "off", 0.0, 0], "no sensor is called 'xxx"),
    (["sensor", 0, "imu", "drunk", 0.0, 0], "a sensor cannot be 'drunk', but ok, off"),
    (["sensor", 0, "imu", "x" * 400, 0.0, 0], "a sensor cannot be 'xxx"),
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
    *(
        (["sensor", 0, "imu", "off", 0.0, ticks], "a fault lasts 0 to")
        for ticks in (-1, 10**8, True)
    ),
    (["sensor", 0, "imu", "off", 0, 0], "not a command"),
]


@pytest.mark.parametrize("command", GOOD, ids=str)
def test_what_can_be_done_is_accepted(command: list[Any]) -> None:
    check_command(command, JOINTS)


@pytest.mark.parametrize(("command", "why"), IMPOSSIBLE, ids=str)
def test_what_cannot_be_done_is_refused_with_its_reason(command: Any, why: str) -> None:
    with pytest.raises(CommandError) as refused:
        check_command(command, JOINTS)
    assert why in str(refused.value)
    assert len(str(refused.value)) < 200


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(LinkParameters._fields) | st.text(max_size=3), inner)
    ),
    max_leaves=6,
)
WORDS = st.sampled_from(["link", "heal", "reference", "push", "unplug", "plug"])


@LAW
@given(st.builds(lambda word, rest: [word, *rest], WORDS, st.lists(JSON, max_size=3)) | JSON)
def test_whatever_comes_is_accepted_or_refused_and_nothing_else_happens(command: Any) -> None:
    with suppress(CommandError):
        check_command(command, JOINTS)


PROBABILITY = st.floats(0.0, 1.0)
TICKS = st.integers(0, DELAY_TICKS_MAX).map(float)
PARAMETERS = st.builds(
    LinkParameters,
    loss=PROBABILITY,
    burst_start=PROBABILITY,
    burst_end=PROBABILITY,
    burst_loss=PROBABILITY,
    delay_ticks=TICKS,
    jitter_ticks=TICKS,
    duplicate=PROBABILITY,
    reorder=PROBABILITY,
    corrupt=PROBABILITY,
    cut=st.sampled_from([0.0, 1.0]),
)


@LAW
@given(PARAMETERS, st.integers(ANY, 20))
def test_link_parameters_reach_the_board_as_they_were(
    parameters: LinkParameters, sender: int
) -> None:
    command = BoardCommand(LINK, sender, tuple(parameters))
    assert decode_board_command(encode_board_command(command)) == command


@LAW
@given(st.floats(-3.2, 3.2), st.integers(ANY, 20))
def test_a_reference_reaches_the_board_as_it_was(rad: float, sender: int) -> None:
    command = BoardCommand(REFERENCE, sender, (rad,))
    assert decode_board_command(encode_board_command(command)) == command


@LAW
@given(st.dictionaries(st.sampled_from(LinkParameters._fields), st.sampled_from([0, 1, 1.0])))
def test_what_is_accepted_a_board_can_read(changes: dict[str, float]) -> None:
    """Whole numbers of a JSON command become floats on the way."""
    if changes:
        check_command(["link", [], changes], JOINTS)
    command = BoardCommand(LINK, 0, tuple(changed(PERFECT, changes)))
    assert decode_board_command(encode_board_command(command)) == command


@LAW
@given(st.binary(max_size=120))
def test_random_bytes_are_no_command(payload: bytes) -> None:
    decoded = decode_board_command(payload)
    assert decoded is None or decoded.kind in (LINK, REFERENCE)


def _link(**changes: Any) -> list[Any]:
    return [LINK, 0, *PERFECT._replace(**changes)]


@pytest.mark.parametrize(
    "fields",
    [
        1,
        "abc",
        {},
        [],
        [REFERENCE],
        [REFERENCE, 0],
        [REFERENCE, 0, 0],  # An int is no float.
        [REFERENCE, 0, nan],
        [REFERENCE, 0, inf],
        [REFERENCE, 0, 3.3],
        [REFERENCE, 0, 0.1, 0.1],
        [REFERENCE, -2, 0.1],
        [REFERENCE, 0.0, 0.1],
        [float(REFERENCE), 0, 0.1],
        [True, 0, *PERFECT],
        [3, 0, 0.1],
        [None, 0, 0.1],
        [[REFERENCE], 0, 0.1],
        [LINK, 0, 0.1],
        [LINK, 0, *PERFECT, 0.0],
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
        encode_board_command(BoardCommand(REFERENCE, 0, (0.1,)))[:-1],
        encode_board_command(BoardCommand(REFERENCE, 0, (0.1,))) + b"\x01",
    ],
    ids=bytes.hex,
)
def test_hostile_bytes_are_no_command(payload: bytes) -> None:
    assert decode_board_command(payload) is None


def test_an_observation_with_the_longest_command_fits_a_frame() -> None:
    command = encode_board_command(BoardCommand(LINK, 127, tuple(PERFECT)))
    assert len(command) == 93
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
    assert concerns(["heal", []], 0, 1)
    assert concerns(["link", [[0, 1]], {}], 0, 1)
    assert not concerns(["link", [[0, 1]], {}], 1, 0)
