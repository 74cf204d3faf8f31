"""States, transitions, fault codes and counters: one table, and pages that say the same."""

import re
from itertools import product
from pathlib import Path

import pytest

from protocol.robot.states import (
    COUNTERS,
    ON_WIRE,
    TRANSITIONS,
    Counters,
    FaultCode,
    State,
    entered,
)
from protocol.wire import frames
from protocol.wire.frames import Reason
from tests.protocol import states_drawn

README = Path(frames.__file__).parents[1].joinpath("README.md").read_text(encoding="utf-8")
LEGAL = {(before, row.after) for row in TRANSITIONS for before in row.before}


@pytest.mark.parametrize("drawn", [states_drawn.table, states_drawn.diagram])
def test_the_page_draws_the_table(drawn: object) -> None:
    """If not: `python -m tests.protocol.states_drawn` prints what the page should have."""
    assert callable(drawn)
    assert drawn() in README


def test_the_page_lists_every_fault_code() -> None:
    assert states_drawn.fault_codes() in README


def test_numbers_on_the_wire_keep_their_meaning() -> None:
    """Those of the first version, and what has come behind them since."""
    assert [(int(state), state.name) for state in ON_WIRE] == [
        (1, "SYNCING"),
        (2, "RUNNING"),
        (3, "HOLDING"),
        (4, "EXTRAPOLATING"),
        (5, "RECKONING"),
        (6, "SAFE"),
        (7, "FAULT"),
    ]
    assert [(int(code), code.title) for code in FaultCode] == [
        (1, "controller raised"),
        (2, "controller no torque"),
        (3, "election raised"),
        (4, "election no vote"),
    ]


@pytest.mark.parametrize(("before", "after"), list(product(State, State)))
def test_what_the_table_does_not_have_is_an_error_of_the_firmware(
    before: State, after: State
) -> None:
    if (before, after) in LEGAL:
        assert entered(before, after) is after
    else:
        with pytest.raises(AssertionError, match=f"from {before.name} to {after.name}"):
            entered(before, after)


def test_no_transition_is_told_twice() -> None:
    told = [(before, row.after) for row in TRANSITIONS for before in row.before]
    assert len(told) == len(set(told))
    assert all(before is not after for before, after in told)


def test_every_state_can_be_reached_and_left() -> None:
    assert {after for _, after in LEGAL} == set(State) - {State.BOOT}
    assert {before for before, _ in LEGAL} == set(State)


def test_a_failed_board_is_only_left_behind() -> None:
    assert [after for before, after in LEGAL if before is State.FAULT] == [State.ENROLLING]


def test_there_is_a_counter_for_each_reason_of_refusal() -> None:
    assert {name for name in COUNTERS if name.startswith("refused_")} == {
        f"refused_{reason}" for reason in Reason
    }
    assert Counters() == (0,) * len(COUNTERS)
    assert all(re.fullmatch(r"[a-z_]+", name) for name in COUNTERS)
