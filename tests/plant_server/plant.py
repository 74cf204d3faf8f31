"""A plant of three joints for tests, and boards that answer whatever a test wants them to."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from plant_server.session.config import PlantConfig
from plant_server.session.lockstep import Lockstep
from plant_server.session.plant import Plant
from plant_server.session.record import TickRecord
from protocol.robot.events import Command, LinkParameters, values_of
from protocol.robot.hardware import Link, UnattendedJoint
from protocol.robot.scenario import RunSettings
from protocol.robot.sensors import EXACT, sensors_of
from protocol.robot.states import State
from protocol.wire.frames import (
    NO_EPOCH,
    LinkUse,
    Observation,
    TorqueFrame,
    decode,
    encode,
)
from protocol.wire.wiring import neighbours

RUN, OTHER_RUN = 0x8000_0001, 0x8000_0002
JOINTS = ("ankle", "knee", "hip")
ANKLE, KNEE, HIP = range(3)
LINK = Link(10.0, 0.5, 0.25, 10.0 * 0.5**2 / 12.0)
LIMIT_NM = 50.0
POSTURE_RAD = (0.1, -0.2, 0.3)
LIMP = UnattendedJoint("limp", 0.0, 0.0)
BRAKED = UnattendedJoint("braked", 0.0, 0.0)
PASSIVE = UnattendedJoint("passive", 80.0, 4.0)


def plant(
    *,
    warm_up_ticks: int = 0,
    ticks: int = 1000,
    seed: int = 0,
    unattended: UnattendedJoint = LIMP,
    events: Iterable[tuple[int, Command]] = (),
    standing: dict[tuple[int, int], LinkParameters] | None = None,
    here: Sequence[int] = (ANKLE, KNEE, HIP),
    **hardware: Any,
) -> Lockstep:
    """A plant whose boards have been admitted, all as incarnation 1.

    `hardware`: what is not ideal, as `PlantConfig` has it.
    """
    config = PlantConfig(
        joints=JOINTS,
        segments=("shank", "thigh", "trunk"),
        links=(LINK, LINK, LINK),
        initial_angles_rad=POSTURE_RAD,
        torque_limits_nm=(LIMIT_NM, LIMIT_NM, LIMIT_NM),
        references_rad=(0.0, 0.0, 0.0),
        unattended=(unattended, unattended, unattended),
        standing_links=standing or {},
        events=tuple(events),
        run=RunSettings(seed=seed, ticks=ticks, tick_s=1e-3, substeps=1, fallen_below=0.5),
        warm_up_ticks=warm_up_ticks,
        sensors=tuple(
            sensors_of(EXACT, imu=board == HIP, force_plate=board == ANKLE)
            for board in (ANKLE, KNEE, HIP)
        ),
    )._replace(**hardware)
    lockstep = Lockstep(Plant(config, run_id=RUN))
    for board in here:
        lockstep.plant.admit(board, 1)
    return lockstep


def torque_frame(
    tick: int,
    torque_nm: float = 0.0,
    *,
    board: int = ANKLE,
    incarnation: int = 1,
    state: State = State.RUNNING,
) -> TorqueFrame:
    receipts = tuple(LinkUse(1, 0, 0) for _ in neighbours(board, 3))
    said = (int(state), 1, 0.0, NO_EPOCH, 0, 0.0, board, 0, 0, receipts)
    return TorqueFrame(RUN, incarnation, tick, torque_nm, *said)


def answer(
    tick: int,
    torque_nm: float = 0.0,
    *,
    board: int = ANKLE,
    incarnation: int = 1,
    state: State = State.RUNNING,
) -> bytes:
    return encode(torque_frame(tick, torque_nm, board=board, incarnation=incarnation, state=state))


def opened(lockstep: Lockstep) -> dict[int, Observation]:
    """Begin and open a tick; what each board that is there is told."""
    lockstep.plant.begin()
    return {board: decode(Observation, payload) for board, payload in lockstep.open()}


def reply(
    lockstep: Lockstep, board: int, torque_nm: float = 0.0, state: State = State.RUNNING
) -> bool:
    """Answer the open tick for a board, as the incarnation that it is."""
    incarnation = lockstep.plant.roster.incarnations[board]
    payload = answer(
        lockstep.plant.tick, torque_nm, board=board, incarnation=incarnation, state=state
    )
    return lockstep.answer(board, payload)


def finish(lockstep: Lockstep, *torques_nm: float) -> TickRecord:
    """Answer the open tick for everybody who has not, and close it."""
    for board in lockstep.waiting_for:
        assert reply(lockstep, board, torques_nm[board] if torques_nm else 0.0)
    return lockstep.close()


def play(lockstep: Lockstep, *torques_nm: float) -> TickRecord:
    """One tick in which everybody who is there answers at once."""
    opened(lockstep)
    return finish(lockstep, *torques_nm)


def happened(record: TickRecord, what: str) -> list[list[Any]]:
    """What events of one kind a tick records, without the name of the kind."""
    values = json.loads(json.dumps([values_of(event) for event in record.events]))
    return [list(content) for kind, *content in values if kind == what]
