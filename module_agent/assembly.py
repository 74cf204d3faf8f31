"""A board put together from its parts, as its configuration asks for.

Here it is decided which class serves a part: our controllers or somebody else's behind a wall, a
hearing that waits for each tick's frame or one that takes the newest. The board never asks.
"""

from module_agent.custom.sandbox import SandboxedController, SandboxedRule
from module_agent.firmware.board import Board, Parts
from module_agent.firmware.body_view import BodyView
from module_agent.firmware.config import BoardConfig
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Controller, ElectionRule
from module_agent.firmware.election import Election
from module_agent.firmware.frame_writer import FrameWriter
from module_agent.firmware.hearing import Hearing, LinkEnd
from module_agent.firmware.lateness import Lateness
from module_agent.firmware.link_model import LinkModel
from module_agent.firmware.own_time.board import OwnTimeBoard
from module_agent.firmware.own_time.mailbox import Mailbox
from module_agent.firmware.own_time.translator import OwnTime
from module_agent.firmware.sensing import Sensing
from module_agent.firmware.servo import servo
from protocol.robot.clocks import Clock
from protocol.robot.hardware import STEADY


def assemble(config: BoardConfig, *, run_id: int, incarnation: int) -> Board:
    """The board of a robot in lockstep, as the plant has admitted it."""
    hearings = [Hearing(link, run_id=run_id, boards=config.boards) for link in _link_models(config)]
    parts = _parts(config, hearings, run_id=run_id, incarnation=incarnation)
    return Board(config, parts, run_id=run_id, incarnation=incarnation)


def assemble_on_own_time(config: BoardConfig, *, run_id: int, incarnation: int) -> OwnTimeBoard:
    """The board of a robot in realtime: the same parts, which count in the board's own periods."""
    own_time = OwnTime(config)
    own = own_time.config
    mailboxes = [
        Mailbox(link, own_time, run_id=run_id, boards=own.boards) for link in _link_models(own)
    ]
    granted = {"run_id": run_id, "incarnation": incarnation}
    board = Board(own, _parts(own, mailboxes, own_time=own_time, **granted), **granted)
    return OwnTimeBoard(board, own_time, mailboxes)


def controller_of(config: BoardConfig) -> Controller:
    """The servo of a board: ours, or the one that its scenario names."""
    return SandboxedController(config.controller, config) if config.controller else servo(config)


def rule_of(config: BoardConfig) -> ElectionRule:
    """The rule of a board's election: ours, or the one that its scenario names."""
    return SandboxedRule(config.rule, config) if config.rule else MaxConsensus(config)


def _link_models(config: BoardConfig) -> list[LinkModel]:
    return [
        LinkModel(seed=config.seed, sender=sender, receiver=config.index, standing=standing)
        for sender, standing in zip(config.neighbours, config.standing_links, strict=True)
    ]


def _parts(
    config: BoardConfig,
    links: "list[Hearing] | list[Mailbox]",
    *,
    run_id: int,
    incarnation: int,
    own_time: OwnTime | None = None,
) -> Parts:
    view = _view(config, own_time)
    ends: list[LinkEnd] = [*links]
    writer = FrameWriter(
        config, ends, view, run_id=run_id, incarnation=incarnation, own_time=own_time
    )
    steady = config.clock == STEADY
    clock = Clock(config.clock, seed=config.seed, board=config.index, tick_s=config.tick_s)
    return Parts(
        hearings=ends,
        sensing=Sensing(
            config.sensor_sheet, tick_s=config.tick_s, has_imu=config.has_imu, uneven=not steady
        ),
        view=view,
        writer=writer,
        servo=controller_of(config),
        election=_election(config, listens_always=own_time is not None),
        lateness=None if steady else Lateness(clock),
    )


def _view(config: BoardConfig, own_time: OwnTime | None) -> BodyView:
    hold_ticks_max = pitch = 0
    if own_time is not None:
        above = own_time.cadence.ticks_per_period[config.index :]
        hold_ticks_max = own_time.slot(own_time.cadence.age_ticks_max)
        pitch = own_time.whole_periods(max(above))
    return BodyView(
        config.link,
        tick_s=config.tick_s,
        lumped_delay_ticks=config.lumped_delay_ticks,
        has_imu=config.has_imu,
        bottom=config.index == 0,
        hold_ticks_max=hold_ticks_max,
        pitch=pitch,
    )


def _election(config: BoardConfig, *, listens_always: bool) -> Election | None:
    if config.election is None:
        return None
    return Election(
        config.election, rule_of(config), board=config.index, listens_always=listens_always
    )
