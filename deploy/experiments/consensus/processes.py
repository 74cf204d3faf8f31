"""The same networks as real processes: one for each board, over Zenoh, without a plant.

Each board waits for the frames of its neighbours, and for nobody else. What it has to say of an
epoch comes back as a line; when all boards have said theirs, the epoch is put together here.
"""

import json
import os
import subprocess
import sys
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from types import TracebackType
from typing import NamedTuple, Self

from deploy.experiments.consensus.network import ConsensusCase, Epoch
from deploy.launch import machine
from deploy.launch.processes import RunFailedError, end
from deploy.launch.rigs import NoPortsError, claim_ports
from module_agent.firmware.controller import Candidate
from module_agent.firmware.elector import RIG, joint
from protocol.process.exit_codes import ExitCode
from protocol.robot.scenario import RigSettings
from protocol.wire.wiring import RUNTIME_THREADS

BOARD_MB = 40
"""Memory of one board's process, generously."""
BOARDS_PER_CORE = 32
"""More would only wait for each other: a tick takes each of them over 0.1 ms of a core."""
NAME = "measure-consensus"
HOST = "127.0.0.1"
WANTED = RigSettings(name=RIG, host=HOST, base_port=17_700)


class BoardReport(NamedTuple):
    """What one board said of one epoch."""

    own: Candidate
    best: Candidate
    learned_round: int
    elected: bool
    begun_ns: int
    learned_ns: int


def boards_max() -> int:
    """How many boards this machine takes as processes."""
    return min(BOARDS_PER_CORE * machine.cores(), machine.free_memory_mb() // BOARD_MB)


def play(case: ConsensusCase) -> Generator[Epoch, None, None]:
    """Play a case, epoch by epoch. Raises `RunFailedError`."""
    try:
        with (
            claim_ports(WANTED, case.boards + 1, Path(), name=NAME) as base_port,
            Electors(case, base_port) as electors,
        ):
            yield from electors.epochs()
    except NoPortsError as error:
        raise RunFailedError(ExitCode.NO_NETWORK, str(error)) from error


class Electors:
    """The boards of a case, as children of this process; a context that leaves none behind."""

    def __init__(self, case: ConsensusCase, base_port: int) -> None:
        self.case = case
        self.base_port = base_port
        self.children: list[subprocess.Popen[str]] = []
        self._lines: SimpleQueue[tuple[int, str]] = SimpleQueue()
        """What the boards write, each with its index; empty when a board has no more to say."""
        self._readers: list[Thread] = []
        self._complaints: dict[int, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        end(self.children)
        for reader in self._readers:
            reader.join()

    def epochs(self) -> Iterator[Epoch]:
        """Start all boards, and put together what they say. Raises `RunFailedError`."""
        for board in range(self.case.boards):
            self._start(board)
        votes: dict[int, list[BoardReport]] = {}
        played = 0
        while played < self.case.epochs:
            board, line = self._lines.get()
            if not line:
                self._ended(board)
                continue
            if not line.startswith("["):
                self._complaints[board] = line.strip()
                continue
            number, urgency, best, *rest = json.loads(line)
            of_epoch = votes.setdefault(number, [])
            of_epoch.append(BoardReport(Candidate(urgency, board), Candidate(*best), *rest))
            if len(of_epoch) == self.case.boards:
                played += 1
                yield _together(number, votes.pop(number))

    def _start(self, board: int) -> None:
        case = self.case
        options = {
            "board": board,
            "neighbours": ",".join(map(str, case.near[board])),
            "boards": case.boards,
            "rounds": case.rounds,
            "watched-rounds": case.watched_rounds,
            "epochs": case.epochs,
            "seed": case.seed,
            "loss": case.loss,
            "host": HOST,
            "base-port": self.base_port,
        }
        words = [word for name, value in options.items() for word in (f"--{name}", str(value))]
        child = subprocess.Popen(
            [sys.executable, "-m", "module_agent.process.elector_runtime", *words, "--lifeline"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={"ZENOH_RUNTIME": RUNTIME_THREADS, **os.environ},
            start_new_session=True,  # A Ctrl-C is for the launcher; it stops its children.
        )
        self.children.append(child)
        reader = Thread(target=self._read, args=(board, child), daemon=True)
        reader.start()
        self._readers.append(reader)

    def _read(self, board: int, child: "subprocess.Popen[str]") -> None:
        assert child.stdout is not None
        with child.stdout as lines:
            for line in lines:
                self._lines.put((board, line))
        self._lines.put((board, ""))

    def _ended(self, board: int) -> None:
        """A board without a word left may go, but not before it has done its part."""
        code = self.children[board].wait()
        if code != ExitCode.OK:
            line = self._complaints.get(board, f"{joint(board)} ended with code {code}")
            raise RunFailedError(ExitCode.PEER_LOST if code < 0 else code, line)


def _together(number: int, votes: Sequence[BoardReport]) -> Epoch:
    """What an epoch came to, from what each board said."""
    largest = max(vote.own for vote in votes)
    agreed = all(vote.best == largest for vote in votes)
    learned_ns = max(vote.learned_ns for vote in votes)
    begun_ns = min(vote.begun_ns for vote in votes)
    return Epoch(
        number,
        max(vote.learned_round for vote in votes) if agreed else None,
        sum(vote.elected for vote in votes),
        # In the first epoch boards are still arriving.
        (learned_ns - begun_ns) / 1e6 if agreed and number > 0 else None,
    )
