"""One board in realtime: the same firmware, at its own rate, from whatever has arrived."""

from dataclasses import replace

import pytest

from module_agent.assembly import assemble_on_own_time
from module_agent.firmware.board import AnsweredError, ReplacedError
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.own_time.board import OwnTimeBoard
from module_agent.firmware.own_time.translator import OwnTime
from protocol.robot.cadence import Cadence
from protocol.robot.events import ReferenceOrder, encode_board_command
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_TICK,
    LinkFrame,
    Neighbour,
    Observation,
    ProtocolError,
    Reason,
    TorqueFrame,
    decode,
    encode,
)
from protocol.wire.wiring import neighbours
from tests.module_agent.robot import FULL, RUN, config, still

CADENCE = Cadence(
    ticks_per_period=(2, 1, 4),
    ticks_per_round=8,
    settle_ticks=20,
    ahead_ticks_max=250,
    age_ticks_max=40,
    catches_up=False,
)


def settings(index: int) -> BoardConfig:
    return config(index, FULL, cadence=CADENCE)


def board(index: int) -> OwnTimeBoard:
    return assemble_on_own_time(settings(index), run_id=RUN, incarnation=1)


def observation(index: int, tick: int, *, command: bytes = b"", incarnation: int = 1) -> bytes:
    roster = tuple(Neighbour(1, NO_TICK, 0) for _ in neighbours(index, 3))
    return encode(Observation(RUN, incarnation, tick, still(index, tick), command, roster))


def reference(rad: float) -> bytes:
    return encode_board_command(ReferenceOrder(rad))


@pytest.mark.parametrize(("index", "delay"), [(0, 4), (1, 9), (2, 1)])
def test_its_time_is_its_own(index: int, delay: int) -> None:
    """10 ms, less one period that goes by on the way, in periods of 2, 1 and 4 ms."""
    own = OwnTime(settings(index)).config
    assert own.lumped_delay_ticks == delay
    assert own.tick_s == pytest.approx(0.001 * CADENCE.ticks_per_period[index])


def test_a_delay_shorter_than_a_period_is_one_period() -> None:
    short = replace(settings(2), lumped_delay_ticks=1)
    assert OwnTime(short).config.lumped_delay_ticks == 1


def test_on_the_wire_ticks_are_the_plants() -> None:
    hip = board(2)
    for slot in range(-8, 6):
        hip.observe(observation(2, 4 * slot))
        said = hip.play(slot)
    link, torque = decode(LinkFrame, said.links[0]), decode(TorqueFrame, said.torque)
    assert (link.tick, link.sample_tick, torque.tick) == (20, 20, 20)
    assert link.heard_tick == NO_TICK


def test_an_observation_holds_until_the_next_one() -> None:
    hip = board(2)
    for slot in range(-8, 6):
        if slot < 2:
            hip.observe(observation(2, 4 * slot))
        torque = decode(TorqueFrame, hip.play(slot).torque)
    assert torque.state == State.HOLDING
    assert hip.used.seen_tick == 4
    for slot in range(6, 20):
        torque = decode(TorqueFrame, hip.play(slot).torque)
    assert (torque.state, torque.torque_nm, torque.enabled) == (State.SAFE, 0.0, 0)


def test_periods_may_be_left_out() -> None:
    hip = board(2)
    for slot in (-8, -7, -3, 0, 1, 7, 8, 400, 401, 402):
        hip.observe(observation(2, 4 * slot))
        torque = decode(TorqueFrame, hip.play(slot).torque)
    assert torque.state == State.RUNNING


def test_commands_in_observations_that_were_overtaken_are_obeyed() -> None:
    hip = board(2)
    hip.observe(observation(2, 0, command=reference(0.25)))
    hip.observe(observation(2, 4))
    assert hip.board.reference_rad == 0.0
    hip.play(1)
    assert hip.board.reference_rad == 0.25
    hip.observe(observation(2, 8, command=reference(0.5)))
    hip.play(2)
    hip.play(3)
    assert hip.board.reference_rad == 0.5


def test_an_older_observation_changes_nothing() -> None:
    hip = board(2)
    hip.observe(observation(2, 8))
    with pytest.raises(AnsweredError):
        hip.observe(observation(2, 8))
    with pytest.raises(ProtocolError) as refused:
        hip.observe(observation(2, 4))
    assert refused.value.reason is Reason.TICK
    assert hip.seen_tick == 8


def test_a_board_that_was_replaced_is_told() -> None:
    with pytest.raises(ReplacedError):
        board(2).observe(observation(2, 8, incarnation=2))
