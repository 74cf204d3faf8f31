"""The table of exit codes."""

from deploy.generated.markdown import attribute_docs, table
from protocol.process.exit_codes import ExitCode, refused
from protocol.wire.enrolment import Verdict


def exit_codes() -> str:
    """Give every exit code with what it means."""
    docs = attribute_docs(ExitCode)
    rows = [(int(code), docs[code.name]) for code in ExitCode]
    refusals = [
        (refused(verdict), f"A board that the plant refuses: {_in_words(verdict)}.")
        for verdict in Verdict
        if verdict is not Verdict.ACCEPTED
    ]
    return table(("code", "meaning"), sorted([*rows, *refusals]))


def _in_words(verdict: Verdict) -> str:
    return verdict.name.lower().replace("_", " ")
