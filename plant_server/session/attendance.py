"""Attendance: which joints are driven by a board, and what the others do meanwhile (S17)."""

from plant_server.body.body import Body
from plant_server.session.config import PlantConfig
from plant_server.session.record import UndrivenJoint
from plant_server.session.roster import Roster
from protocol.robot.events import EnergyLoss
from protocol.robot.hardware import UnattendedJoint
from protocol.robot.states import State
from protocol.wire.frames import TorqueFrame

NOT_YET = (State.SYNCING, State.FAULT)
"""A board that has not driven its joint so far does not begin to in these states."""


class Attendance:
    """The joints of one body."""

    def __init__(self, config: PlantConfig, body: Body) -> None:
        self.config = config
        self.body = body
        self.undriven_since: list[int | None] = [None] * len(config.joints)
        """Since which tick nobody drives a joint; None: somebody does."""

    def drive(self, board: int) -> None:
        """Give a joint to its board."""
        self.undriven_since[board] = None
        self.body.release(board)

    def begin(self, board: int, frame: TorqueFrame | None) -> None:
        """Give a joint to its board with the first torque that the board means."""
        if frame is not None and frame.state not in NOT_YET:
            self.drive(board)

    def leave(self, board: int, tick: int) -> EnergyLoss | None:
        """Leave a joint alone; what happened to the body by it, if anything."""
        if self.undriven_since[board] is None:
            self.undriven_since[board] = tick
        match self.config.unattended[board]:
            case UnattendedJoint(how="braked"):
                return EnergyLoss(board, self.body.brake(board))
            case UnattendedJoint(
                how="passive", stiffness_nm_rad=stiffness, damping_nm_s_rad=damping
            ):
                self.body.make_passive(board, stiffness, damping)
            case _:
                self.body.release(board)
        return None

    def undriven(self, roster: Roster) -> tuple[UndrivenJoint, ...]:
        """Joints that nobody drives."""
        config = self.config
        return tuple(
            UndrivenJoint(config.joints[i], since_tick, config.unattended[i].how, roster.present(i))
            for i, since_tick in enumerate(self.undriven_since)
            if since_tick is not None
        )
