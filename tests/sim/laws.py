"""Safety: what must hold in every tick, whatever goes wrong (S1 to S21).

Each law is checked on what the plant records and the boards say, against what the simulator itself
knows to have happened, never against what the product believes of itself.
"""

from math import copysign, fabs, isfinite

from module_agent.firmware.board import Board
from module_agent.firmware.body_view import FORGET_EVERY_TICKS
from module_agent.firmware.hearing import EARLY_FRAMES_MAX, Hearing, LinkEnd
from plant_server.session.record import TickRecord
from protocol.robot.events import DELAY_TICKS_MAX, PERFECT
from protocol.robot.hardware import IDEAL
from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, NO_TICK, LinkFrame, TorqueFrame, decode
from tests.sim.agreement import Agreement
from tests.sim.broken import BrokenLawError
from tests.sim.robot import Robot

LATE_FRAMES_MAX = 2 * (2 * DELAY_TICKS_MAX + 2)
"""Two copies of every frame of the last 64 ticks."""
OUTBOX_MAX = 400
"""A simulated run has fewer commands than half of this; what has no bound grows beyond it."""


def law(holds: bool, name: str, detail: object = "") -> None:
    """Raise `BrokenLawError` unless it holds."""
    if not holds:
        raise BrokenLawError(name, str(detail))


class Laws:
    """The checker of one run."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.lockstep = robot.twin.lockstep
        self.agreement = Agreement(robot)
        self.limits_nm = robot.twin.lockstep.plant.config.torque_limits_nm
        self.next_tick = robot.twin.lockstep.plant.tick
        self.completed: dict[tuple[int, int], int] = {}
        """By board and tick: the incarnation that answered."""
        self.last_incarnation = [0] * robot.twin.lockstep.plant.size
        self.held_nm = [0.0] * robot.twin.lockstep.plant.size
        self.nan_ticks = [0] * robot.twin.lockstep.plant.size

    def check(self, record: TickRecord) -> dict[int, TorqueFrame]:
        """Judge one tick; return what the boards said in it."""
        law(record.tick == self.next_tick, "ticks are gap-free", record.tick)
        self.next_tick += 1
        said = self._answers(record)
        for board, applied_nm in enumerate(record.torques_nm):
            self._torque(board, applied_nm, said.get(board))
        if not self.lockstep.plant.body.fallen:
            numbers = (*record.angles_rad, *record.rates_rad_s, *record.torques_nm)
            law(all(map(isfinite, numbers)), "no NaN in state or torques", numbers)
        for board, frame in said.items():
            self._board(self.robot.ticked[board], frame)
            self._heard(self.robot.ticked[board], frame)
            self.completed[board, record.tick] = frame.incarnation
        for board, frame in said.items():
            self.last_incarnation[board] = frame.incarnation
        self._plant(record)
        self.agreement.check(record.tick, said)
        return said

    def _answers(self, record: TickRecord) -> dict[int, TorqueFrame]:
        """S2, S5: recorded is what living boards said in this tick, and nothing else."""
        said = {}
        for board, payload in enumerate(record.answers):
            truth = self.robot.answered.get(board, b"")
            law(payload == truth, "S5 an answer is what its living board said", board)
            if payload:
                frame = decode(TorqueFrame, payload)
                living = self.robot.ticked[board].incarnation
                law(frame.tick == record.tick, "an answer is of its tick", frame)
                law(frame.incarnation == living, "an answer is of the living incarnation", frame)
                said[board] = frame
        return said

    def _torque(self, board: int, applied_nm: float, frame: TorqueFrame | None) -> None:
        """No torque is applied but what a living board said, within its limit."""
        if frame is None:
            self.held_nm[board] = 0.0
            law(applied_nm == 0.0, "a joint without an answer gets no torque", board)
            return
        if isfinite(frame.torque_nm):
            self.nan_ticks[board] = 0
            limit = self.limits_nm[board]
            usable = copysign(min(fabs(frame.torque_nm), limit), frame.torque_nm)
            self.held_nm[board] = usable
        else:
            self.nan_ticks[board] += 1
            if self.nan_ticks[board] > IDEAL.hold_ticks:
                self.held_nm[board] = 0.0
        expected = self.held_nm[board] if frame.tick >= 0 else 0.0
        syncing = frame.state == State.SYNCING
        law(not syncing or frame.torque_nm == 0.0, "S17 a syncing board sends 0 N m", frame)
        law(applied_nm == expected, "the torque applied is the torque said", (board, applied_nm))

    def _board(self, firmware: Board, frame: TorqueFrame) -> None:
        """What a board says and keeps by itself."""
        numbers = (frame.controlled_rad, frame.urgency)
        if not self.lockstep.plant.body.fallen:
            law(all(map(isfinite, (frame.torque_nm, *numbers))), "no NaN in torque frames", frame)
        driving = frame.state not in (State.SYNCING, State.SAFE)
        may_be_enabled = driving or frame.tick < 0
        law(not frame.enabled or may_be_enabled, "enabled only when running", frame)
        view = firmware.view
        bound = view._kept_ticks + FORGET_EVERY_TICKS
        for stored in (view._joint, view._imu, view._lower, view._complete):
            law(len(stored) <= bound, "S9 stores are bounded", len(stored))
        index = firmware.config.index
        told = self.lockstep.plant.roster
        if told.incarnations[index] == firmware.incarnation and not told._outboxes[index]:
            same = firmware.reference_rad == told.references_rad[index]
            law(same, "S15 a board has the reference that the plant knows", frame)
            for sender, hearing in zip(firmware.config.neighbours, firmware.hearings, strict=True):
                same = hearing.link.parameters == told.links[sender, index]
                law(same, "S15 a link is as the plant knows it", (sender, index))

    def _heard(self, firmware: Board, frame: TorqueFrame) -> None:
        """S4, S5, S14: used are frames of completed ticks of the last incarnation; none is lost."""
        index, tick = firmware.config.index, frame.tick
        law(len(frame.links) == len(firmware.hearings), "a receipt for every link", frame)
        ends = zip(firmware.config.neighbours, firmware.hearings, frame.links, strict=True)
        for sender, hearing, use in ends:
            for age in range(use.heard_mask.bit_length()):
                if use.heard_mask >> age & 1:
                    said_by = self.completed.get((sender, tick - 1 - age))
                    used = said_by is not None and said_by == self.last_incarnation[sender]
                    law(used, "S5 only frames of completed ticks are used", (sender, index, age))
            completed = self.completed.get((sender, tick - 1))
            there = completed is not None and completed == self.robot.rostered[sender]
            was_there = self.completed.get((index, tick - 1)) == frame.incarnation
            if (sender, index) in self.robot.excused:
                law(not use.heard_mask & 1, "S6 an excused frame is not used", (sender, index))
            elif there and was_there and hearing.link.parameters == PERFECT:
                law(bool(use.heard_mask & 1), "S14 a good link loses nothing", (sender, index))
            self._bounded(hearing)

    def _bounded(self, hearing: LinkEnd) -> None:
        assert isinstance(hearing, Hearing), "the robot is one in lockstep"
        law(len(hearing._waiting) <= EARLY_FRAMES_MAX, "mailboxes are bounded", hearing._waiting)
        late = sum(map(len, hearing._late.values()))
        law(late <= LATE_FRAMES_MAX, "frames on the way are bounded", late)

    def _plant(self, record: TickRecord) -> None:
        longest = max(map(len, self.lockstep.plant.roster._outboxes))
        law(longest <= OUTBOX_MAX, "outboxes are bounded", longest)
        for payload in self.robot.said if record.tick % 8 == 0 else ():
            frame = decode(LinkFrame, payload)
            finite = all(map(isfinite, (frame.urgency, *frame[-7:])))
            law(finite or self.lockstep.plant.body.fallen, "no NaN in link frames", frame)
            law(frame.sample_tick == NO_TICK or frame.sample_tick <= frame.tick, "S9 no future")
            law(frame.epoch >= NO_EPOCH, "epochs are counted from 0", frame)
