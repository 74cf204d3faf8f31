"""Wiring: exactly the chain's cables and one to the plant for each board, dialled from one side."""

from typing import Any

import pytest

from deploy.scenario_file.load import load
from protocol.wire.wiring import Rig, board_session, neighbours, plant_session, rig_of

SIZES = (1, 2, 3, 7, 40)


def _rig(boards: int) -> Rig:
    return Rig("robot", "127.0.0.1", 17700, boards)


LEFT = ["rig.name=left", "rig.host=10.0.0.1", "rig.base_port=4000"]


def _configs(rig: Rig) -> list[dict[str, Any]]:
    """Of the plant, then of the boards from the ground up."""
    return [plant_session(rig), *(board_session(rig, board) for board in range(rig.boards))]


def _cables(rig: Rig) -> list[tuple[int, int]]:
    """Who dials whom; 0 is the plant and 1 + i is board i."""
    configs = _configs(rig)
    listening = {config["listen"]["endpoints"][0]: i for i, config in enumerate(configs)}
    return [
        (i, listening[endpoint])
        for i, config in enumerate(configs)
        for endpoint in config["connect"]["endpoints"]
    ]


@pytest.mark.parametrize("boards", SIZES)
def test_the_cables_are_the_chain_and_the_plant(boards: int) -> None:
    to_plant = {(1 + i, 0) for i in range(boards)}
    chain = {(1 + i, i) for i in range(1, boards)}
    cables = _cables(_rig(boards))
    assert set(cables) == to_plant | chain
    assert len(cables) == len(set(cables))


@pytest.mark.parametrize("boards", SIZES)
def test_one_side_of_each_pair_dials(boards: int) -> None:
    """Mutual dialling gives two links and can split for good (zenoh issue 2806)."""
    cables = _cables(_rig(boards))
    assert len({frozenset(pair) for pair in cables}) == len(cables)
    assert all(dialler > listener for dialler, listener in cables)


@pytest.mark.parametrize("boards", SIZES)
def test_boards_with_a_cable_are_the_mechanical_neighbours(boards: int) -> None:
    wired = {frozenset((a - 1, b - 1)) for a, b in _cables(_rig(boards)) if b > 0}
    assert wired == {frozenset((i, n)) for i in range(boards) for n in neighbours(i, boards)}


@pytest.mark.parametrize("boards", SIZES)
def test_neighbourhood_is_mutual_and_told_from_the_ground_up(boards: int) -> None:
    for board in range(boards):
        near = neighbours(board, boards)
        assert list(near) == sorted(near)
        assert all(board in neighbours(other, boards) for other in near)
        assert board not in near
    assert neighbours(0, 1) == ()


def test_ports_are_base_and_base_plus_one_plus_board() -> None:
    """S3: a board that is plugged back listens where its neighbours dial."""
    listening = [config["listen"]["endpoints"] for config in _configs(_rig(3))]
    assert listening == [[f"tcp/127.0.0.1:{port}"] for port in (17700, 17701, 17702, 17703)]


@pytest.mark.parametrize("boards", SIZES)
def test_every_session_admits_everybody_that_may_dial_and_some_more(boards: int) -> None:
    """S3: plant boards + 16, board degree + 4, where the plant counts as a degree."""
    plant, *rest = _configs(_rig(boards))
    assert plant["transport"]["unicast"]["max_sessions"] == boards + 16
    for board, config in enumerate(rest):
        degree = len(neighbours(board, boards)) + 1
        assert config["transport"]["unicast"]["max_sessions"] == degree + 4


def test_nobody_is_found_who_was_not_dialled() -> None:
    for config in _configs(_rig(3)):
        assert config["mode"] == "peer"
        assert config["scouting"]["multicast"] == {"enabled": False}
        assert config["scouting"]["gossip"] == {"enabled": False}
        assert config["transport"]["unicast"]["max_links"] == 1


def test_a_cable_that_is_pulled_is_dialled_again_for_ever() -> None:
    for config in _configs(_rig(3)):
        assert config["connect"]["timeout_ms"] == -1
        assert config["connect"]["exit_on_failure"] is False
        assert config["listen"]["exit_on_failure"] is True, "a port in use is the user's to know"


def test_the_rig_is_read_from_the_scenario() -> None:
    scenario = load("paper", LEFT)
    assert rig_of(scenario) == Rig("left", "10.0.0.1", 4000, boards=3)


@pytest.mark.parametrize(("mode", "lease_ms"), [("lockstep", 3_600_000), ("realtime", 400)])
def test_who_is_silent_is_gone_in_realtime_and_waited_for_in_lockstep(
    mode: str, lease_ms: int
) -> None:
    """S7: the same lease on both ends of every cable."""
    found = _configs(rig_of(load("paper", [*LEFT, f"run.mode={mode}"])))
    assert {config["transport"]["link"]["tx"]["lease"] for config in found} == {lease_ms}
