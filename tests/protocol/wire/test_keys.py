"""Keys: exact, distinct, of the design's shape, and readable on the way back."""

import re
from itertools import permutations

from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.wire import keys
from protocol.wire.frames import VERSION
from protocol.wire.timing import Timing

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,15}", fullmatch=True)
JOINTS = ("ankle", "knee", "hip", "neck")


def test_keys_are_those_of_the_specification() -> None:
    assert keys.observation("robot", "knee") == "dec/v2/robot/plant/knee/observation"
    assert keys.torque("robot", "knee") == "dec/v2/robot/knee/torque"
    assert keys.link("robot", "knee", "hip") == "dec/v2/robot/knee/link/hip"
    assert keys.report("robot", "knee", Timing) == "dec/v2/robot/knee/timing"
    assert keys.end("robot") == "dec/v2/robot/plant/@end"
    assert keys.plant_alive("robot") == "dec/v2/robot/plant/@alive"
    assert keys.alive("robot", "knee", 0xBEEF) == "dec/v2/robot/knee/@alive/000000000000beef"


def _all_keys(rig: str) -> list[str]:
    each = [
        f(rig, joint)
        for f in (
            keys.observation,
            keys.torque,
            keys.stalled,
            lambda r, j: keys.report(r, j, Timing),
            keys.fault,
            lambda r, j: keys.alive(r, j, 1),
        )
        for joint in JOINTS
    ]
    links = [keys.link(rig, *pair) for pair in permutations(JOINTS, 2)]
    return [*each, *links, keys.end(rig), keys.control(rig), keys.plant_alive(rig)]


def test_no_two_purposes_share_a_key_and_no_two_rigs_share_any() -> None:
    both = _all_keys("left") + _all_keys("right")
    assert len(set(both)) == len(both)


def test_keys_carry_the_version_and_no_wildcard() -> None:
    """Locality is a property of the wiring only while nobody declares `*`."""
    for key in _all_keys("robot"):
        assert key.startswith(f"dec/v{VERSION}/robot/")
        assert "*" not in key


def test_enrolment_is_outside_version_and_rig() -> None:
    """S2: what does not fit must still be answered."""
    assert keys.ENROL == "dec/@enrol"


def _matches(expression: str, key: str) -> bool:
    """Zenoh's `*`: exactly one chunk, which does not start with `@`."""
    return re.fullmatch(expression.replace("*", "[^/@][^/]*"), key) is not None


def test_the_plant_sees_every_board_alive_and_nothing_else() -> None:
    expression = keys.any_alive("robot")
    seen = [key for key in _all_keys("robot") + _all_keys("other") if _matches(expression, key)]
    assert seen == [keys.alive("robot", joint, 1) for joint in JOINTS]


@settings(deadline=None, derandomize=True)
@given(NAMES, NAMES, st.integers(0, 2**64 - 1))
def test_a_token_names_its_board(rig: str, joint: str, boot: int) -> None:
    key = keys.alive(rig, joint, boot)
    assert keys.board_of(key) == (joint, boot)
    assert len(key) == len(keys.alive(rig, joint, 0)), "of fixed width"
    assert _matches(keys.any_alive(rig), key)


@settings(deadline=None, derandomize=True)
@given(NAMES, NAMES)
def test_a_report_names_its_board(rig: str, joint: str) -> None:
    assert keys.joint_of(keys.stalled(rig, joint)) == joint
    assert keys.joint_of(keys.fault(rig, joint)) == joint
    assert keys.joint_of(keys.trace(rig, joint)) == joint
