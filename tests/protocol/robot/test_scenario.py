"""The digest is of what a scenario means; the run is named by it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from deploy.scenario_file import load as scenario_file
from protocol.process.resolving import load
from protocol.robot.canonical_json import canonical_json
from protocol.robot.scenario import Controls, Scenario, ScenarioError, canonical, decode, run_id

SETTINGS = [
    "run.pace=0.5",
    "event=[{at_s = 1.0, do = 'push', segment = 'trunk', force_n = 10.0}]",
    "link=[{link = 'ankle-knee', loss = 0.1}]",
]
EVERYTHING = scenario_file.load("hardware", SETTINGS)
"""A scenario that says something in every one of its tables."""
CHOICES = {"body-sway", "joint-angle", "link-orientation", "controlled-variable", "each-side"}
CHOICES |= {"limp", "skip"}
"""Texts that are one of a few: another text is refused."""


def tables() -> dict[str, Any]:
    """Of `EVERYTHING`, as they are written."""
    found: dict[str, Any] = json.loads(canonical(EVERYTHING))
    return found


def leaves(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(tree, dict | list):
        places = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, value in places:
            yield from leaves(value, (*path, key))
    else:
        yield path


def set_at(path: tuple[Any, ...], value: Any) -> bytes:
    """The scenario as it is written, with another value at one place."""
    whole = tables()
    *parents, last = path
    place: Any = whole
    for key in parents:
        place = place[key]
    place[last] = value
    return canonical_json(whole)


def value_at(path: tuple[Any, ...]) -> Any:
    place: Any = tables()
    for key in path:
        place = place[key]
    return place


def another(value: Any) -> Any:
    """A value that may stand in its place as well."""
    match value:
        case bool():
            return not value
        case float() | int():
            return value * 0.99 if isinstance(value, float) and value else value + 1
        case str():
            return value + "x"
    return {"class": "my_servo:Mine", "sha256": "0" * 64}


# --- The digest ----------------------------------------------------------------------------------

MEANT = [
    path
    for path in leaves(tables())
    if value_at(path) is not None and value_at(path) not in CHOICES
    if path[:-1] not in {("link", 0), ("link", 1), ("event", 0, 1)}
]
"""Places of the values that can be changed a little."""


@pytest.mark.parametrize("path", MEANT, ids=lambda path: ".".join(map(str, path)))
def test_the_digest_changes_with_everything_but_the_rig(path: tuple[Any, ...]) -> None:
    """Where a robot lives is not what it is; everything else is."""
    same = decode(set_at(path, another(value_at(path)))).digest == EVERYTHING.digest
    assert same == (path[0] == "rig")


def test_the_digest_ignores_the_order_of_keys() -> None:
    backwards = dict(reversed(tables().items()))
    assert decode(json.dumps(backwards).encode()).digest == EVERYTHING.digest
    assert len(EVERYTHING.digest) == 32


def test_the_digest_depends_on_the_order_of_boards() -> None:
    turned = replace(EVERYTHING, boards=EVERYTHING.boards[::-1])
    assert turned.digest != EVERYTHING.digest


def test_the_paper_is_written_as_it_always_was() -> None:
    """What others may have computed from the specification, and recorded: a digest is for good."""
    paper = scenario_file.load("paper")
    assert paper.digest.hex().startswith("0355d000bf068bfe85b8f8fe")
    assert EVERYTHING.digest.hex().startswith("c8db0edf1a51df0d9dd85bf5")
    assert canonical(paper).startswith(b'{"board":[{"actuator":{"hold_ticks":10,"lag_s":0.0,')
    assert b'"imu_noise_rad_per_sqrt_hz":3.490658503988659e-05' in canonical(EVERYTHING)


def test_values_that_are_no_numbers_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical_json({"mass_kg": float("nan")})


# --- Reading -------------------------------------------------------------------------------------


def test_what_is_written_is_read_back_as_it_was() -> None:
    assert decode(canonical(EVERYTHING)) == EVERYTHING
    assert EVERYTHING.boards[0].controls is Controls.BODY_SWAY
    assert type(EVERYTHING) is Scenario


@pytest.mark.parametrize(
    ("path", "value", "complaint"),
    [
        (("run", "ticks"), 0, "run.ticks: expected int >= 1"),
        (("run", "seed"), 2**63, "run.seed: expected int <= 9223372036854775807"),
        (("run", "more"), 1, "run: object contains unknown field more"),
        (("board", 1, "link", "mass_kg"), "10", "board.1.link.mass_kg: expected float, got str"),
        (("board", 2, "imu"), 1, "board.2.imu: expected bool, got int"),
        (("board", 0, "controls"), "toes", "board.0.controls: invalid enum value 'toes'"),
        (("board", 0, "servo"), {}, "board.0.servo: object missing required field kp_nm_rad"),
        (("board", 2, "joint"), "knee", "board.2.joint: 'knee' is already another's"),
        (("board", 1, "ticks_per_period"), 2, "board.1.ticks_per_period: goes with realtime"),
        (("board",), [], "board: expected array of length >= 1"),
        (("link_names",), ["one"], "link_names: 1 names for 3 boards"),
        (("link",), [[0, 2, {"loss": 0.1}]], "link.0: ankle and hip have no link"),
        (("link",), [[0, 1, {"loss": 1.1}]], "link.0: loss: expected float <= 1.0"),
        (("event", 0, 1, 1), 7, "event.0: there is no board 7; the body has ankle, knee, hip"),
        (("event", 0, 0), -1, "event.0.0: expected int >= 0"),
        (
            ("election", "rule"),
            {"class": "mine:Mine", "sha256": "0" * 64},
            "rig.sources: there is no file of mine",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_its_path(
    path: tuple[Any, ...], value: object, complaint: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        decode(set_at(path, value))
    assert str(caught.value).startswith(complaint)


def test_a_scenario_in_hand_cannot_become_one_that_does_not_go_together() -> None:
    with pytest.raises(ValueError, match="link_names: 3 names for 2 boards"):
        replace(EVERYTHING, boards=EVERYTHING.boards[:2])


@settings(deadline=None, derandomize=True)
@given(st.binary(min_size=32, max_size=32))
def test_a_run_id_has_a_fixed_width_and_follows_from_the_digest(digest: bytes) -> None:
    """S1: five bytes in msgpack, whatever the scenario, so no frame changes its size."""
    assert len(msgpack.packb(run_id(digest))) == 5
    assert run_id(digest) == run_id(digest) != 0
    assert run_id(digest) & 0x7FFF_FFFF == int.from_bytes(digest[:4], "little") & 0x7FFF_FFFF


def test_a_resolved_scenario_is_read_back_with_its_digest(tmp_path: Path) -> None:
    file = tmp_path / "resolved.json"
    file.write_text(json.dumps(tables(), indent=2))
    scenario = load(str(file), [])
    assert (scenario, scenario.digest) == (EVERYTHING, EVERYTHING.digest)
    assert scenario.joints == ["ankle", "knee", "hip"]


@pytest.mark.parametrize("text", [None, "", "{", "\xff", "{}", "[]", "3"])
def test_a_file_that_cannot_be_read_is_one_line_for_the_user(
    tmp_path: Path, text: str | None
) -> None:
    file = tmp_path / "broken.json"
    if text is not None:
        file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ScenarioError, match=r"broken\.json: "):
        load(str(file), [])
