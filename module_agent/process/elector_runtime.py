"""Drives one board without a body with Zenoh (`python -m module_agent.process.elector_runtime`).

It waits until each neighbour hears it, then ticks as fast as the neighbours' frames come, and
writes what it has to say of every epoch as a line of JSON: the fields of `Ballot`, then when the
epoch began and when the board knew its best, on this machine's monotonic clock.
"""

import argparse
import hashlib
import json
import sys
import time
from contextlib import suppress
from dataclasses import asdict
from queue import Empty, SimpleQueue
from typing import Any

import zenoh

from module_agent.firmware.elector import RIG, Elector, ElectorConfig, joint
from module_agent.process.network import is_up, publisher
from protocol.process.exit_codes import ExitCode
from protocol.process.stopping import (
    StoppedError,
    ignore_signals,
    stop_at_end_of_input,
    stop_on_signals,
)
from protocol.robot.canonical_json import canonical_json
from protocol.robot.scenario import run_id
from protocol.wire import keys
from protocol.wire.wiring import Rig, elector_session, set_runtime_threads

SAY_AGAIN_AFTER_S = 0.5
"""A frame that is missing for longer may have been lost with a connection: all say theirs again."""
LINGER_S = 1.0
"""How long a board that is done stays for neighbours that are not."""


def main() -> int:
    """Elect until all epochs are over, and return the exit code."""
    arguments = _arguments()
    config = _config(arguments)
    rig = Rig(RIG, arguments.host, arguments.base_port, config.boards)
    try:
        stop_on_signals()
        if arguments.lifeline:
            stop_at_end_of_input()
        set_runtime_threads()
        session = elector_session(rig, config.index, config.neighbours)
        with zenoh.open(zenoh.Config.from_json5(json.dumps(session))) as opened:
            try:
                ElectorRuntime(opened, config, epochs=arguments.epochs).run()
            finally:
                ignore_signals()
    except zenoh.ZError as error:
        detail = "it is in use" if "in use" in str(error) else str(error)
        line = f"cannot listen at {rig.endpoint(1 + config.index)}, choose another --base-port"
        print(f"{joint(config.index)}: {line}: {detail}", file=sys.stderr)
        return ExitCode.NO_NETWORK
    except StoppedError:
        print(f"{joint(config.index)}: stopped", file=sys.stderr)
        return ExitCode.STOPPED
    return ExitCode.OK


class ElectorRuntime:
    """One process, from its session to the end of the last epoch."""

    def __init__(self, session: zenoh.Session, config: ElectorConfig, *, epochs: int) -> None:
        self.config = config
        self.elector = Elector(config, run_id=_run_id(config, epochs))
        self.ticks = epochs * config.period_ticks
        me, others = joint(config.index), [joint(board) for board in config.neighbours]
        self.heard: list[SimpleQueue[zenoh.Sample]] = [SimpleQueue() for _ in others]
        """Frames of each neighbour. Every tick needs all, so one is waited for at a time."""
        self._matching: SimpleQueue[Any] = SimpleQueue()
        self._links = [publisher(session, keys.link(RIG, me, other)) for other in others]
        self._declared = [
            *(
                session.declare_subscriber(
                    keys.link(RIG, other, me), zenoh.handlers.Callback(frames.put, indirect=False)
                )
                for other, frames in zip(others, self.heard, strict=True)
            ),
            *(
                link.declare_matching_listener(
                    zenoh.handlers.Callback(self._matching.put, indirect=False)
                )
                for link in self._links
            ),
        ]
        self._said: tuple[bytes, ...] = ()
        self._begun_ns = self._learned_ns = 0

    def run(self) -> None:
        """Play all epochs."""
        self._meet()
        while self.elector.next_tick < self.ticks:
            self._gather(forever=True)
            self._tick()
        self._gather(forever=False)  # Who is here has all that it needs of this board.

    def _meet(self) -> None:
        """Wait until whatever is said is heard at the other end of every link."""
        while not all(map(is_up, self._links)):
            with suppress(Empty):
                self._matching.get(timeout=SAY_AGAIN_AFTER_S)

    def _gather(self, *, forever: bool) -> None:
        """Wait for the neighbours' frames of the tick before: the barrier."""
        elector, deadline = self.elector, time.monotonic() + LINGER_S
        while (link := elector.missing()) is not None:
            try:
                elector.hear(
                    link, self.heard[link].get(timeout=SAY_AGAIN_AFTER_S).payload.to_bytes()
                )
            except Empty:
                self._say()
            if not forever and time.monotonic() > deadline:
                return

    def _tick(self) -> None:
        elector = self.elector
        self._said = elector.tick()
        self._say()
        now_ns = time.monotonic_ns()
        if elector.round == 0:
            self._begun_ns = now_ns
        if elector.round == elector.learned_round:
            self._learned_ns = now_ns
        ballot = elector.ballot()
        if ballot is not None:
            print(json.dumps((*ballot, self._begun_ns, self._learned_ns)), flush=True)

    def _say(self) -> None:
        for link, payload in zip(self._links, self._said, strict=False):
            link.put(payload)


def _run_id(config: ElectorConfig, epochs: int) -> int:
    """Name the run after all that its boards must have in common; others refuse its frames."""
    common = {**asdict(config), "index": 0, "neighbours": [], "epochs": epochs}
    return run_id(hashlib.sha256(canonical_json(common)).digest())


def _config(arguments: argparse.Namespace) -> ElectorConfig:
    return ElectorConfig(
        index=arguments.board,
        neighbours=arguments.neighbours,
        boards=arguments.boards,
        seed=arguments.seed,
        loss=arguments.loss,
        rounds=arguments.rounds,
        watched_rounds=max(arguments.rounds, arguments.watched_rounds),
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m module_agent.process.elector_runtime",
        description="One board without a body: it elects with its neighbours, to measure that.",
        epilog="Example, one process of a pair: python -m module_agent.process.elector_runtime"
        " --board 0 --neighbours 1 --boards 2 --rounds 1 --epochs 10",
    )
    parser.add_argument("--board", type=int, required=True, help="index of this board, from 0")
    parser.add_argument(
        "--neighbours",
        type=indices,
        required=True,
        metavar="I,J",
        help="indices of the boards it has links to",
    )
    parser.add_argument("--boards", type=int, required=True, help="how many there are")
    parser.add_argument(
        "--rounds", type=int, required=True, help="R: rounds until the boards latch"
    )
    parser.add_argument(
        "--watched-rounds", type=int, default=0, help="play so many, to see late agreement"
    )
    parser.add_argument("--epochs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1, help="of urgencies and lost frames")
    parser.add_argument("--loss", type=float, default=0.0, help="of every link, 0 to 1")
    parser.add_argument("--host", default="127.0.0.1", help="address that all boards listen on")
    parser.add_argument(
        "--base-port", type=int, default=17700, help="board I listens on this + 1 + I"
    )
    parser.add_argument("--lifeline", action="store_true", help="end when standard input ends")
    arguments = parser.parse_args()
    others = set(range(arguments.boards)) - {arguments.board}
    if arguments.board not in range(arguments.boards) or not others.issuperset(
        arguments.neighbours
    ):
        parser.error("a board and its neighbours are different ones of --boards, counted from 0")
    return arguments


def indices(text: str) -> tuple[int, ...]:
    """Read `0,2`. Raises ValueError."""
    return tuple(sorted({int(word) for word in text.split(",")}))


if __name__ == "__main__":
    sys.exit(main())
