"""How a process tells the one that started it why it ended."""

from enum import IntEnum

REFUSED_BASE = 10
"""A board that the plant refuses ends with this and the verdict: 11 wrong version, and so on."""


class ExitCode(IntEnum):
    """Exit codes of the plant, of a board and of `decmesh`, but for refusals (see `refused`)."""

    OK = 0
    FAILED = 1
    """Something that should not happen; a traceback says what."""
    BAD_INPUT = 2
    """The command line, the scenario, or what was compiled cannot be used; nothing was started."""
    FELL = 3
    """The body fell: a result, not an error."""
    NO_NETWORK = 4
    """A port is taken or an address cannot be used."""
    PEER_LOST = 5
    """A board, or the plant, went away in the middle of a run."""
    NO_OUTPUT = 6
    """The folder for results cannot be written, or holds results already."""
    REPLACED = 7
    """The plant has given this board's joint to another process."""
    REFUSED = 8
    """A command that a running robot cannot carry out."""
    UNFIT = 9
    """`decmesh doctor` found something on this machine that does not work."""
    STOPPED = 130
    """Ctrl-C, SIGTERM, or the process that started this one is gone."""


def refused(verdict: int) -> int:
    """Exit code of a board that the plant refuses with a `protocol.wire.enrolment.Verdict`."""
    return REFUSED_BASE + verdict
