"""Talking to a running robot from a terminal: how is it, and do this to it.

Every command goes to the plant, which puts it in order with all others and tells for which tick.
"""

import json
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from zlib import decompress

import msgpack
import zenoh

from deploy.failure import FailedError
from deploy.launch import rigs
from deploy.scenario_file.event_tables import directed_pairs
from deploy.scenario_file.ticks import MeaningError
from protocol.process.exit_codes import ExitCode
from protocol.robot.events import Command, Pairs, values_of
from protocol.wire import keys
from protocol.wire.frames import VERSION, seal
from protocol.wire.wiring import Rig, set_runtime_threads, terminal_session

ANSWER_WITHIN_S = 3.0
ASK_AGAIN_S = 0.2


class LiveError(FailedError):
    """What was asked of a running robot cannot be done."""


def find_rig(wanted: str | None) -> Rig:
    """The robot that is meant: the only one that runs, or one by its name, run folder or address.

    Raises `LiveError` when none or several fit.
    """
    if wanted is not None and ":" in wanted:
        host, _, port = wanted.rpartition(":")
        name, _, host = host.rpartition("@")
        if port.isdigit():
            return Rig(name or "robot", host, int(port), 0)
    found = rigs.running()
    called = set() if wanted is None else {wanted, str(Path(wanted).resolve())}
    fitting = [rig for rig in found if wanted is None or called & _names(rig)]
    if len(fitting) == 1:
        rig = fitting[0]
        return Rig(rig["name"], rig["host"], rig["base_port"], 0)
    if not found:
        line = "no robot is running; start one with decmesh run, or say --rig HOST:PORT"
        raise LiveError(ExitCode.BAD_INPUT, line)
    known = ", ".join(f"{rig['base_port']} ({rig['scenario']}, {rig['run']})" for rig in found)
    which = "several robots are running"
    if wanted is not None:
        which = f"{'several robots are' if fitting else 'no running robot is'} called {wanted!r}"
    raise LiveError(ExitCode.BAD_INPUT, f"{which}; choose with --rig: {known}")


def _names(rig: dict[str, Any]) -> set[str]:
    return {str(rig["base_port"]), rig["name"], rig["scenario"], rig["run"]}


class Terminal:
    """A connection to one robot's plant; a context."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        set_runtime_threads()
        config = json.dumps(terminal_session(rig))
        self.session = zenoh.open(zenoh.Config.from_json5(config))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self.session.close()  # type: ignore[no-untyped-call]

    def status(self) -> dict[str, Any]:
        """How the robot is, as the plant sees it. Raises `LiveError`."""
        return self._ask("status")

    def command(self, command: Command) -> int:
        """Have a command carried out; return the tick in which it takes effect.

        Raises `LiveError` if it cannot.
        """
        tick: int = self._ask(json.dumps(values_of(command)))["tick"]
        return tick

    def _ask(self, request: str) -> dict[str, Any]:
        payload = seal(msgpack.packb((VERSION, request)))
        deadline = time.monotonic() + ANSWER_WITHIN_S
        while time.monotonic() < deadline:
            key = keys.control(self.rig.name)
            for reply in self.session.get(key, payload=payload, timeout=ASK_AGAIN_S):
                if reply.ok is None:
                    continue
                answer: dict[str, Any] = json.loads(decompress(reply.ok.payload.to_bytes()))
                if "refused" in answer:
                    raise LiveError(ExitCode.REFUSED, answer["refused"])
                return answer
        where = self.rig.endpoint(0)
        raise LiveError(ExitCode.PEER_LOST, f"the plant at {where} does not answer")


def pairs_of(link: str, status: dict[str, Any], *, one_way: bool) -> Pairs:
    """Directed links that a name stands for. Raises `LiveError`."""
    joints = [board["joint"] for board in status["boards"]]
    try:
        return directed_pairs(link, joints, one_way=one_way)
    except MeaningError as error:
        raise LiveError(ExitCode.BAD_INPUT, str(error).removeprefix("link: ")) from error


def index_of(name: str, names: list[str], what: str) -> int:
    """Which one a name stands for. Raises `LiveError`."""
    if name not in names:
        line = f"there is no {what} {name!r}; there are {', '.join(names)}"
        raise LiveError(ExitCode.BAD_INPUT, line)
    return names.index(name)
