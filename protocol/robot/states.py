"""What a board can be doing, what can be wrong with it, and what it counts.

Rule 1: a state is entered by a transition of the table below, and by no other; anything else is an
        error of the firmware.
Rule 2: numbers on the wire keep their meaning; new ones come behind.

`protocol/README.md` draws the table.
"""

from enum import IntEnum
from typing import NamedTuple


class State(IntEnum):
    """Firmware state of a board. What is not in `ON_WIRE` is before its first torque frame."""

    SYNCING = 1
    """Fills its delay line; its torque is 0."""
    RUNNING = 2
    """Drives its joint on complete samples."""
    HOLDING = 3
    """Drives on the newest older sample (S9)."""
    EXTRAPOLATING = 4
    """Drives on samples extrapolated by their rates (S9)."""
    RECKONING = 5
    """Takes what lies above for rigid, and its orientation from the foot up (S9)."""
    SAFE = 6
    """Its sensors have said nothing plausible for too long: no torque, and not enabled."""
    FAULT = 7
    """Its controller or its election has failed: no torque, not enabled, until it is replaced."""
    BOOT = 8
    """Starts; nobody knows of it yet."""
    ENROLLING = 9
    """Asks the plant to be let in, and waits for its first observation."""


ON_WIRE = tuple(state for state in State if state not in (State.BOOT, State.ENROLLING))
"""States that a torque frame can tell."""
DRIVING = (State.RUNNING, State.HOLDING, State.EXTRAPOLATING, State.RECKONING)
"""States in which the servo is asked for a torque."""


class Transition(NamedTuple):
    """From any of some states into another, and why."""

    before: tuple[State, ...]
    after: State
    cause: str


TRANSITIONS = (
    Transition((State.BOOT,), State.ENROLLING, "it is on the network"),
    Transition((State.ENROLLING,), State.SYNCING, "its first tick has come"),
    Transition(
        (State.SYNCING, State.HOLDING, State.EXTRAPOLATING, State.RECKONING, State.SAFE),
        State.RUNNING,
        "the sample that it needs is complete",
    ),
    Transition(
        (State.SYNCING, State.RUNNING, State.EXTRAPOLATING, State.RECKONING, State.SAFE),
        State.HOLDING,
        "that sample is not; the newest complete one is up to 5 ticks older",
    ),
    Transition(
        (State.SYNCING, State.HOLDING, State.RECKONING, State.SAFE),
        State.EXTRAPOLATING,
        "the newest complete one is 6 to 25 ticks older",
    ),
    Transition(
        (State.SYNCING, State.EXTRAPOLATING, State.SAFE),
        State.RECKONING,
        "there is none of the last 25 ticks",
    ),
    Transition(
        (State.SYNCING, *DRIVING),
        State.SAFE,
        "its own sensors have said nothing plausible for more than 10 ticks",
    ),
    Transition((*DRIVING, State.SAFE), State.FAULT, "its controller or its election has failed"),
    Transition(
        (State.SYNCING, *DRIVING, State.SAFE, State.FAULT),
        State.ENROLLING,
        "the plant is gone, or has gone on without it",
    ),
    Transition(
        (State.RUNNING,),
        State.EXTRAPOLATING,
        "6 to 25 ticks older at one go: turns were left out, in realtime",
    ),
    Transition(
        (State.RUNNING, State.HOLDING),
        State.RECKONING,
        "older than that at one go: turns were left out, in realtime",
    ),
)
_LEGAL = frozenset((before, row.after) for row in TRANSITIONS for before in row.before)


def entered(before: State, after: State) -> State:
    """The state after a transition, which the table must have."""
    assert (before, after) in _LEGAL, f"no way from {before.name} to {after.name}"
    return after


class FaultCode(IntEnum):
    """What has failed on a board in state `FAULT`."""

    CONTROLLER_RAISED = 1
    """The controller raised an exception, when it was made or when it was asked."""
    CONTROLLER_NO_TORQUE = 2
    """The controller answered with what is no finite number."""
    ELECTION_RAISED = 3
    """The election raised an exception, when it was made or when it was asked."""
    ELECTION_NO_VOTE = 4
    """The election answered with what no vote can be."""

    @property
    def title(self) -> str:
        """Its name in words."""
        return self.name.lower().replace("_", " ")


class Counters(NamedTuple):
    """Everything that a board counts, since its admission.

    It is also the telemetry: a torque frame carries one of these, the next tick the next, and so on
    around. Numbers keep their meaning: new ones come behind.
    """

    held_ticks: int = 0
    extrapolated_ticks: int = 0
    reckoned_ticks: int = 0
    implausible_samples: int = 0
    """Own sensors that said what no body can have."""
    incomplete_epochs: int = 0
    """Elections in which not everybody was heard."""
    refused_size: int = 0
    refused_corrupt: int = 0
    refused_version: int = 0
    refused_malformed: int = 0
    refused_run: int = 0
    refused_incarnation: int = 0
    refused_epoch: int = 0
    refused_tick: int = 0
    refused_range: int = 0
    """Frames, by the reason for which they were refused."""
    inconsistent_samples: int = 0
    """Own sensors of which one contradicts another, or itself a moment ago."""
    stuck_samples: int = 0
    """An own sensor that says the same for ever, though the joint must have moved."""


COUNTERS = Counters._fields
