"""How a process tells the one that started it why it ended."""

from enum import IntEnum

REFUSED_BASE = 10
"""A board that the plant refuses ends with this and the verdict: 11 wrong version, and so on."""


class ExitCode(IntEnum):
    """Exit codes of the plant, of a board and of `decmesh`, but for refusals (see `refused`)."""

    OK = 0
    """The run came to its end, also when boards died on the way and it went on without them.

    `run.mcap` and standard error name such boards; `summary.json` does not."""
    FAILED = 1
    """Something that should not happen, with a traceback. Of `decmesh replay`: a value differs."""
    BAD_INPUT = 2
    """The command line, the scenario, or what was compiled cannot be used; nothing was started."""
    FELL = 3
    """The body fell: a result with its summary, not an error."""
    NO_NETWORK = 4
    """A port is taken or an address cannot be used."""
    PEER_LOST = 5
    """The plant died or does not answer, or a board died before the run had begun."""
    NO_OUTPUT = 6
    """The folder for results cannot be written, holds results already, or is full."""
    REPLACED = 7
    """Of a board: the plant has given its joint to another process."""
    REFUSED = 8
    """A command that a running robot cannot carry out."""
    UNFIT = 9
    """`decmesh doctor` found something on this machine that does not work."""
    STOPPED = 130
    """Ctrl-C, SIGTERM, or the process that started this one is gone."""


def refused(verdict: int) -> int:
    """Exit code of a board that the plant refuses with an `EnrolmentVerdict` (`wire.enrolment`)."""
    return REFUSED_BASE + verdict
