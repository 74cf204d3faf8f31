"""Enrolment, the plant's side: who may drive which joint (S2).

Rule 1: every request is answered, and a refusal names both sides.
Rule 2: a joint has one driver. Another boot is let in only when the one before is gone.
Rule 3: incarnations are counted per joint, so they do not depend on who came first.
Rule 4: boards that outlived the plant before this one tell in which run they were; the next one has
        another name, so that nothing said in the old one fits.
"""

from dataclasses import dataclass

from protocol.robot.scenario import next_run_id, run_id
from protocol.wire.enrolment import EnrolmentReply, EnrolmentRequest, EnrolmentVerdict
from protocol.wire.frames import VERSION
from protocol.wire.wiring import neighbours


@dataclass(slots=True)
class Seat:
    """What the plant knows of one joint's board."""

    incarnation: int = 0
    boot: int | None = None
    """None: nobody is there."""
    links_up: int = 0
    told_run: int = 0
    """The run that it was last told of."""


class Enrolment:
    """Decides over requests; pure."""

    def __init__(self, *, rig: str, joints: list[str], digest: bytes) -> None:
        self.rig = rig
        self.joints = joints
        self.digest = digest
        self.run_id = run_id(digest)
        self.begun = False
        """The run has had its first tick, and keeps its name."""
        self.seats = [Seat() for _ in joints]

    @property
    def enrolled(self) -> set[int]:
        """Boards that are let in, whether they take part already or not."""
        return {board for board, seat in enumerate(self.seats) if seat.boot is not None}

    @property
    def absent(self) -> list[str]:
        """Joints that have no board."""
        seats = zip(self.joints, self.seats, strict=True)
        return [joint for joint, seat in seats if seat.boot is None]

    def decide(self, request: EnrolmentRequest) -> EnrolmentReply:
        """Let a board in, or say why not. Asking again changes nothing but `links_up`."""
        verdict, reason = self._verdict(request)
        incarnation = 0
        if verdict is EnrolmentVerdict.ACCEPTED:
            seat = self.seats[self.joints.index(request.joint)]
            if seat.boot != request.boot:
                seat.incarnation += 1
                seat.boot = request.boot
            seat.links_up = request.links_up
            if request.former_run == self.run_id and not self.begun:
                self.run_id = next_run_id(self.run_id)
            seat.told_run = self.run_id
            incarnation = seat.incarnation
        return EnrolmentReply(VERSION, verdict, reason, self.run_id, incarnation)

    def gone(self, board: int, boot: int) -> bool:
        """A process has ended; tell whether it held the joint."""
        seat = self.seats[board]
        if seat.boot != boot:
            return False
        seat.boot = None
        seat.links_up = 0
        return True

    def dismiss(self, board: int) -> None:
        """Give up on a board that is there but silent; it may enrol again."""
        self.seats[board].boot = None
        self.seats[board].links_up = 0

    def linked(self, board: int) -> bool:
        """Whether a board is here, and hears and is heard by each neighbour that is here too."""
        if self.seats[board].boot is None or self.seats[board].told_run != self.run_id:
            return False
        return all(
            self._reaches(board, other) and self._reaches(other, board)
            for other in neighbours(board, len(self.joints))
            if self.seats[other].boot is not None
        )

    def _reaches(self, sender: int, receiver: int) -> bool:
        link = neighbours(sender, len(self.joints)).index(receiver)
        return bool(self.seats[sender].links_up >> link & 1)

    def _verdict(self, request: EnrolmentRequest) -> tuple[EnrolmentVerdict, str]:
        if request.version != VERSION:
            return EnrolmentVerdict.WRONG_VERSION, (
                f"the board speaks version {request.version}, the plant version {VERSION}"
            )
        if request.rig != self.rig:
            return EnrolmentVerdict.WRONG_RIG, (
                f"the board belongs to rig {request.rig!r}, the plant to rig {self.rig!r}"
            )
        if request.joint not in self.joints:
            return EnrolmentVerdict.UNKNOWN_JOINT, (
                f"the board is for joint {request.joint!r}, the body has {', '.join(self.joints)}"
            )
        if request.scenario_digest != self.digest:
            return EnrolmentVerdict.OTHER_SCENARIO, (
                f"the board was started with scenario {request.scenario_digest.hex()[:12]},"
                f" the plant with {self.digest.hex()[:12]}; give both the same file and settings"
            )
        holder = self.seats[self.joints.index(request.joint)].boot
        if holder is not None and holder != request.boot:
            return EnrolmentVerdict.JOINT_TAKEN, (
                f"{request.joint} has a board already, boot {holder:016x};"
                f" this is {request.boot:016x}"
            )
        return EnrolmentVerdict.ACCEPTED, ""
