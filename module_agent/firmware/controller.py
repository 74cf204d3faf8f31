"""The two doors for controllers: what a servo and an election are told, and what they answer.

Rule 1: our own `Servo` and `MaxConsensus` come through these doors, as anybody's class does.
Rule 2: a controller is told what its board may know, and nothing else. It is made once, with the
        board's `BoardConfig`; then it is asked once a tick, in the order of the ticks.
Rule 3: an answer follows from what was told so far. A controller that looks at a clock, at chance
        or at a file makes a run that cannot be repeated.

`deploy/docs/own-controllers.md` has an example for each.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from module_agent.firmware.body_view import AngleAndRate, BodySample
from protocol.robot.states import FaultCode, State
from protocol.wire.frames import Observation


class ServoInput(NamedTuple):
    """What a servo is told in one tick; all but `observation` is one lumped delay old."""

    tick: int
    """The tick now; negative ones are never asked for."""
    enabled: bool
    """The enabling variable y: whether to move to the reference, or to hold."""
    reference_rad: float
    """Where the controlled variable should go while enabled."""
    error_rad: float
    """The paper's epsilon: from the reference while enabled, else from the value that is held."""
    rate_rad_s: float
    """Rate of what the error is of."""
    controlled: AngleAndRate
    """The controlled variable alpha: `rad` and `rad_s`."""
    body: BodySample
    """Own `joint` and own `link` in space, and `supported`: mass and centre of mass of all that the
    joint carries, seen from it."""
    state: State
    """How good that sample is: running, holding, extrapolating or reckoning."""
    observation: Observation
    """Own sensors as they came in this very tick, unchecked: `readings` has torque, force plate and
    the rest."""


class FaultError(Exception):
    """A controller from outside has failed; it concerns its own board alone."""

    def __init__(self, code: FaultCode, *, summary: str, trace: str) -> None:
        super().__init__(summary)
        self.code = code
        self.summary = summary
        """What was raised and where, without what differs between machines."""
        self.trace = trace
        """The traceback, for people."""


class Controller(Protocol):
    """A servo: torque from what a board knows."""

    def torque_nm(self, seen: ServoInput) -> float:
        """Torque on the joint, positive turns the link above forwards. Never called when unsafe."""
        ...


class Candidate(NamedTuple):
    """Compared field by field, so that equal urgencies still have one maximum."""

    urgency: float
    board: int


class Round(NamedTuple):
    """What an election is told in one tick of an epoch: of its opening, and of each round."""

    tick: int
    epoch: int
    number: int
    """0 opens the epoch; then rounds 1 to R, one a tick."""
    last: bool
    """Whether this is round R, after which y is latched."""
    urgency: float
    """Own w, as it is in this tick: |controlled variable - reference|."""
    heard: Sequence[Candidate]
    """What neighbours have said of this epoch since the round before; none in round 0."""
    complete: bool
    """Whether in each round so far every neighbour that is there was heard."""
    enabled: bool
    """The enabling variable y as it is."""


class Vote(NamedTuple):
    """What an election answers."""

    best: Candidate
    """What the neighbours hear of this epoch from now on."""
    enabled: bool
    """The enabling variable y, if this is the last round; else it does not count."""


class ElectionRule(Protocol):
    """An election, one board's part of it."""

    def vote(self, now: Round) -> Vote:
        """Play one round."""
        ...
