"""Controllers from outside: a class in somebody's own file, and a wall around it.

Rule 1: what is executed are the bytes whose hash is in the scenario, so boards that were started
        with different files refuse each other.
Rule 2: a file is executed anew for each board, so boards share no memory in the twin either.
Rule 3: whatever such a class does, short of never coming back, what passes the wall is a finite
        torque or a possible vote, or a `FaultError` that concerns this board alone.
"""

import sys
import traceback
from functools import cache
from hashlib import sha256
from importlib.abc import SourceLoader
from importlib.util import module_from_spec, spec_from_loader
from math import isfinite
from numbers import Integral, Real
from pathlib import Path, PurePath
from types import TracebackType
from typing import Any

from module_agent.firmware.config import BoardConfig, Source
from module_agent.firmware.controller import Candidate, FaultError, Round, ServoInput, Vote
from protocol.robot.scenario import ScenarioError
from protocol.robot.states import FaultCode

URGENCY_MAX = 1e6
"""Neighbours refuse a larger one."""
FAILURES = (Exception, SystemExit)
"""What a controller may raise at its own expense. What ends the process is not among it."""


def fault(code: FaultCode, error: BaseException) -> FaultError:
    """Tell what a controller has raised, for the wire and for people."""
    theirs = _theirs(error.__traceback__)
    trace = "".join(traceback.format_exception(type(error), error, theirs))
    return FaultError(code, summary="\n".join(summary(error)), trace=trace)


def summary(error: BaseException) -> list[str]:
    """What an exception says, and then where it came from, the innermost line first."""
    whole = traceback.TracebackException(type(error), error, _theirs(error.__traceback__))
    *_, what = whole.format_exception_only()
    lines = [what.strip()]
    if isinstance(error, SyntaxError):
        lines.append(f"{PurePath(error.filename or '').name}:{error.lineno}")
    lines += (
        f"{PurePath(call.filename).name}:{call.lineno} in {call.name}: {call.line}"
        for call in reversed(whole.stack)
    )
    return lines


class _Sandboxed:
    """Somebody else's object; it is made at once, but fails only when it is asked."""

    def __init__(self, source: Source, config: BoardConfig, raised: FaultCode) -> None:
        self._raised = raised
        self._fault: FaultError | None = None
        self._theirs: Any = None
        try:
            self._theirs = load(source)(config)
        except FAILURES as error:
            self._fault = fault(raised, error)

    def _ask(self, method: str, question: object) -> Any:
        if self._fault is not None:
            raise self._fault
        try:
            return getattr(self._theirs, method)(question)
        except FAILURES as error:
            raise fault(self._raised, error) from error


class SandboxedController(_Sandboxed):
    """A servo from outside."""

    def __init__(self, source: Source, config: BoardConfig) -> None:
        super().__init__(source, config, FaultCode.CONTROLLER_RAISED)

    def torque_nm(self, seen: ServoInput) -> float:
        """Its torque. Raises `FaultError`."""
        answer = self._ask("torque_nm", seen)
        try:
            return _torque(answer)
        except FAILURES as error:
            raise fault(FaultCode.CONTROLLER_NO_TORQUE, error) from error


class SandboxedRule(_Sandboxed):
    """An election from outside."""

    def __init__(self, source: Source, config: BoardConfig) -> None:
        super().__init__(source, config, FaultCode.ELECTION_RAISED)
        self._boards = config.boards

    def vote(self, now: Round) -> Vote:
        """Its vote. Raises `FaultError`."""
        answer = self._ask("vote", now)
        try:
            return _vote(answer, self._boards)
        except FAILURES as error:
            raise fault(FaultCode.ELECTION_NO_VOTE, error) from error


def check(config: BoardConfig) -> None:
    """See that a board's files are those that its scenario means. Raises `ScenarioError`."""
    for source in (config.controller, config.rule):
        if source is not None:
            read(source)


def load(source: Source) -> Any:
    """Execute a file and return its class. Raises `ScenarioError`, and whatever the file raises."""
    module_name, _, class_name = source.reference.partition(":")
    loader = _Loader(source)
    spec = spec_from_loader(module_name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    root = str(Path(source.path).parents[module_name.count(".")])
    if root not in sys.path:
        sys.path.append(root)  # What the file imports may lie beside it.
    sys.modules.setdefault(module_name, module)
    loader.exec_module(module)
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        raise ScenarioError(f"{source.path} has no class {class_name}")
    return found


@cache
def read(source: Source) -> bytes:
    """Read the file once, and check that it is the one that is meant. Raises `ScenarioError`."""
    try:
        content = Path(source.path).read_bytes()
    except OSError as error:
        raise ScenarioError(f"{source.path}: cannot be read: {error.strerror}") from error
    if sha256(content).hexdigest() != source.sha256:
        raise ScenarioError(f"{source.path}: has changed since the scenario was resolved")
    return content


class _Loader(SourceLoader):
    """Compiles the very bytes that were checked, and no cache of others."""

    def __init__(self, source: Source) -> None:
        self.source = source

    def get_filename(self, _fullname: str) -> str:
        return self.source.path

    def get_data(self, _path: str | bytes) -> bytes:
        return read(self.source)


def _torque(answer: Any) -> float:
    if not (isinstance(answer, Real) and isfinite(answer)):
        raise ValueError(f"torque_nm answered {_shown(answer)}, which is no finite number")
    return float(answer)


def _vote(answer: Any, boards: int) -> Vote:
    match answer:
        case [[Real() as urgency, Integral() as board], bool(enabled)]:
            best = Candidate(float(urgency), int(board))
            if 0.0 <= best.urgency <= URGENCY_MAX and 0 <= best.board < boards:
                return Vote(best, enabled)
    raise ValueError(f"vote answered {_shown(answer)}, which no vote can be")


def _shown(answer: Any) -> str:
    """What it was, without what differs from one process to the next."""
    if type(answer) in (float, int, bool, Vote):
        return repr(answer)[:120]
    return f"a {type(answer).__name__}"


def _theirs(trace: TracebackType | None) -> TracebackType | None:
    """The part of a traceback that is not of this file, nor of the import system."""
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        if name != __file__ and not name.startswith("<frozen importlib"):
            return trace
        trace = trace.tb_next
    return None
