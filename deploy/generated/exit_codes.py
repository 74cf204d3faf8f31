"""The table of exit codes."""

from deploy.generated.markdown import attribute_docs, table
from protocol.process.exit_codes import ExitCode, refused
from protocol.wire.enrolment import EnrolmentVerdict


def exit_codes() -> str:
    """Give every exit code with what it means."""
    docs = attribute_docs(ExitCode)
    rows = [(int(code), docs[code.name]) for code in ExitCode]
    refusals = [
        (refused(verdict), f"A board that the plant refuses: {_in_words(verdict)}.")
        for verdict in EnrolmentVerdict
        if verdict is not EnrolmentVerdict.ACCEPTED
    ]
    return table(("code", "meaning"), sorted([*rows, *refusals]))


def _in_words(verdict: EnrolmentVerdict) -> str:
    return verdict.name.lower().replace("_", " ")
