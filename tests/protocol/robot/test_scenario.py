"""The digest is of what a scenario means; the run is named by it."""

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.robot.scenario import KEYS, ScenarioError, canonical, load, resolved, run_id

VALUES: dict[str, Any] = {
    "name": "paper",
    "run": {"seed": 1, "ticks": 1000, "tick_s": 0.001, "substeps": 1},
    "rig": {"name": "robot", "host": "127.0.0.1", "base_port": 17700},
    "election": {"enabled": True, "period_ticks": 100, "rounds": 2},
    "board": [{"joint": "ankle", "imu": False}, {"joint": "hip", "imu": True}],
}


def _leaves(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(tree, dict | list):
        places = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, value in places:
            yield from _leaves(value, (*path, key))
    else:
        yield path


def _changed(path: tuple[Any, ...]) -> dict[str, Any]:
    """The scenario with one value changed a little."""
    values = copy.deepcopy(VALUES)
    *parents, last = path
    place: Any = values
    for key in parents:
        place = place[key]
    old = place[last]
    place[last] = (not old) if isinstance(old, bool) else old + ("x" if type(old) is str else 1)
    return values


@pytest.mark.parametrize("path", list(_leaves(VALUES)), ids=lambda path: ".".join(map(str, path)))
def test_the_digest_changes_with_everything_but_the_rig(path: tuple[Any, ...]) -> None:
    """Where a robot lives is not what it is; everything else is."""
    same = resolved(_changed(path)).digest == resolved(VALUES).digest
    assert same == (path[0] == "rig")


def test_the_digest_ignores_a_rig_that_is_not_there_and_the_order_of_keys() -> None:
    backwards = {key: VALUES[key] for key in reversed(VALUES) if key != "rig"}
    assert resolved(backwards).digest == resolved(VALUES).digest
    assert len(resolved(VALUES).digest) == 32


def test_the_digest_depends_on_the_order_of_boards_and_on_types() -> None:
    turned = {**VALUES, "board": VALUES["board"][::-1]}
    assert resolved(turned).digest != resolved(VALUES).digest
    typed = {**VALUES, "election": {**VALUES["election"], "rounds": 2.0}}
    assert resolved(typed).digest != resolved(VALUES).digest


def test_values_that_are_no_numbers_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical({"mass_kg": float("nan")})


@settings(deadline=None, derandomize=True)
@given(st.binary(min_size=32, max_size=32))
def test_a_run_id_has_a_fixed_width_and_follows_from_the_digest(digest: bytes) -> None:
    """S1: five bytes in msgpack, whatever the scenario, so no frame changes its size."""
    assert len(msgpack.packb(run_id(digest))) == 5
    assert run_id(digest) == run_id(digest) != 0
    assert run_id(digest) & 0x7FFF_FFFF == int.from_bytes(digest[:4], "little") & 0x7FFF_FFFF


def test_a_resolved_scenario_is_read_back_with_its_digest(tmp_path: Path) -> None:
    file = tmp_path / "resolved.json"
    values = {**dict.fromkeys(KEYS), **VALUES}
    file.write_text(json.dumps(values, indent=2))
    scenario = load(str(file), [])
    assert scenario == resolved(values)
    assert scenario.joints == ["ankle", "hip"]


@pytest.mark.parametrize("text", [None, "", "{", "\xff", "{}", "[]", "3"])
def test_a_file_that_cannot_be_read_is_one_line_for_the_user(
    tmp_path: Path, text: str | None
) -> None:
    file = tmp_path / "broken.json"
    if text is not None:
        file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ScenarioError, match=r"broken\.json: "):
        load(str(file), [])
