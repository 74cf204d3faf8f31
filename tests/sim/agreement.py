"""The laws of the election: whose urgency counts, when y may change, and who may be enabled.

S13 is claimed of epoch e, of T_e and R ticks, when in all ticks e T_e ... e T_e + R
    (a) the same incarnations were on the roster, and answered,
    (b) those that elect (no longer syncing at e T_e) stand next to each other, and R reaches
        from one end of them to the other,
    (c) none was in safe state,
and when in every tick after the first every one of them heard, in the tick after it was said, the
frame of every neighbour that elects. A board that is syncing still has no epoch: it passes nothing
on. With `keep-last` its neighbours find the epoch incomplete (S12), so there (b) is asked of all.
"""

from collections.abc import Iterator
from math import fabs

from protocol.robot.states import State
from protocol.wire.frames import NO_EPOCH, TorqueFrame
from tests.sim.broken import BrokenLawError
from tests.sim.robot import Robot

Said = dict[int, TorqueFrame]


class Agreement:
    """What the boards elect, epoch after epoch."""

    def __init__(self, robot: Robot) -> None:
        election = robot.twin.scenario.election
        self.robot = robot
        self.period_ticks = election.period_ticks
        self.rounds = election.rounds
        self.keeps_last = election.incomplete == "keep-last"
        self.claims: set[tuple[float, int]] = set()
        """Urgencies of this epoch and whose they are, as their owners said."""
        self.window: list[Said] = []
        """What was said since the epoch began, tick by tick."""
        self.rosters: set[tuple[int, ...]] = set()
        """Who was on the roster since the epoch began."""
        self.enabled: dict[tuple[int, int], int] = {}
        """By board and incarnation, y after the last tick."""
        self.electing: set[int] = set()
        self.claimed_epochs = 0
        self.latched: tuple[int, ...] = ()
        """Boards enabled at the last latch."""

    def check(self, tick: int, said: Said) -> None:
        """Judge one tick of the election."""
        epoch, since = divmod(tick, self.period_ticks)
        if tick >= 0:
            if since == 0:
                self.electing = {b for b, f in said.items() if f.state != State.SYNCING}
                self.claims = {(said[b].urgency, b) for b in self.electing}
                self.window, self.rosters = [], set()
            self.rosters.add(self.robot.rostered)
            self.window.append(said)
            self.electing &= {b for b in said if said[b].incarnation == self._began(b)}
            for board, frame in said.items():
                self._gossip(board, frame, epoch, since)
        if tick >= 0 and since == self.rounds:
            self._latch(said)
        self._constant(tick, since, said)

    def _gossip(self, board: int, frame: TorqueFrame, epoch: int, since: int) -> None:
        """S11: what a board says is of this epoch, and somebody's who was there."""
        firmware = self.robot.ticked[board]
        if frame.state == State.SYNCING:
            _law(frame.epoch == NO_EPOCH, "a syncing board has no epoch", frame)
        if frame.epoch == NO_EPOCH:
            _law(board not in self.electing, "S11 who elects has an epoch", frame)
            return
        _law(frame.epoch == epoch, "S11 gossip is of this epoch", frame)
        _law(frame.round == min(since, self.rounds), "S11 one round is one tick", frame)
        claimed = (frame.urgency, frame.candidate) in self.claims
        _law(claimed, "S11 an urgency is one that a living board claims", frame)
        if since == 0:
            error_rad = fabs(frame.controlled_rad - firmware.reference_rad)
            own = error_rad if frame.state != State.SAFE else 0.0
            mine = (frame.urgency, frame.candidate) == (own, board)
            _law(mine, "S11 w is the error of the sample, its own", frame)

    def _constant(self, tick: int, since: int, said: Said) -> None:
        """Y changes when an epoch is latched, and at no other time, but to 0 for safety."""
        for board, frame in said.items():
            before = self.enabled.get((board, frame.incarnation))
            if before is None and tick > 0:
                _law(not frame.enabled, "S11 a new board starts with y = 0", frame)
            elif before is not None and frame.state != State.SAFE:
                same = frame.enabled == before or (since == self.rounds and tick >= 0)
                _law(same, "S11 y changes at a latch only", frame)
        self.enabled = {(b, frame.incarnation): frame.enabled for b, frame in said.items()}

    def _latch(self, said: Said) -> None:
        """S13, and what holds of fewer conditions."""
        enabled = tuple(board for board, frame in said.items() if frame.enabled)
        self.latched = enabled
        if not self._same_members():
            return
        voters = self.electing
        if voters and not self.keeps_last:
            _law(bool(enabled), "who has the largest urgency of all is enabled", said)
            best = max((w, b) for w, b in self.claims)[1]
            _law(best in enabled, "who has the largest urgency of all is enabled", best)
        if self._s13():
            self.claimed_epochs += 1
            _law(len(enabled) == 1, "S13 exactly one is enabled", (enabled, self.claims))

    def _same_members(self) -> bool:
        """(a) and (c)."""
        if len(self.window) != self.rounds + 1 or len(self.rosters) != 1:
            return False
        first = {board: frame.incarnation for board, frame in self.window[0].items()}
        return all(
            {board: frame.incarnation for board, frame in said.items()} == first
            and not any(frame.state == State.SAFE for frame in said.values())
            for said in self.window
        )

    def _began(self, board: int) -> int:
        """The incarnation with which a board began the epoch."""
        frame = self.window[0].get(board)
        return 0 if frame is None else frame.incarnation

    def _s13(self) -> bool:
        """(b), and that everything was heard."""
        voters = sorted(self.electing)
        if not voters or voters[-1] - voters[0] != len(voters) - 1:
            return False
        if len(voters) - 1 > self.rounds:
            return False
        if self.keeps_last and len(voters) != len(self.window[0]):
            return False
        return all(heard & 1 for said in self.window[1:] for heard in self._masks(said))

    def _masks(self, said: Said) -> Iterator[int]:
        """Receipts of the links between boards that elect."""
        for board in self.electing:
            near = self.robot.ticked[board].config.neighbours
            for sender, use in zip(near, said[board].links, strict=True):
                if sender in self.electing:
                    yield use.heard_mask


def _law(holds: bool, name: str, detail: object) -> None:
    if not holds:
        raise BrokenLawError(name, str(detail))
