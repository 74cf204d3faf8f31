"""A robot in realtime, on a wall clock that the test moves: boards oversleep, clocks drift.

The plant and the boards are the product's own, and so is what lies between a board and its network
(`Cycle`). Made up are time, the network's latency, and a host that is busy now and then. What comes
out is what a run would have recorded.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from random import Random
from typing import Any

from module_agent.assembly import assemble_on_own_time
from module_agent.firmware.board import AnsweredError
from module_agent.firmware.config import board_config
from module_agent.firmware.own_time.cycle import Cycle
from plant_server.session.config import plant_config
from plant_server.session.free_running import FreeRunning
from plant_server.session.pace import Pace
from plant_server.session.plant import Plant
from plant_server.session.record import Outcome, TickRecord, TickWallTimes
from plant_server.spool.spool import PLANT, Spool
from protocol.robot.events import Plug, Unplug
from protocol.robot.scenario import Scenario, run_id
from protocol.wire.frames import ProtocolError
from protocol.wire.trace import TickTrace
from protocol.wire.trace_differences import decode_trace

US, MS = 1_000, 1_000_000


@dataclass(kw_only=True)
class Host:
    """How quick and how busy the host is; times in ns."""

    seed: int = 1
    wake_ns: tuple[int, int] = (20 * US, 120 * US)
    turn_ns: tuple[int, int] = (150 * US, 300 * US)
    latency_ns: tuple[int, int] = (80 * US, 250 * US)
    plant_ns: tuple[int, int] = (60 * US, 120 * US)
    """How long a tick of the plant takes; more than a tick: the host is too slow."""
    stall: float = 0.0
    """Probability that the plant is held up, by up to `busy_ns`."""
    busy: float = 0.0
    """Probability that a board oversleeps by up to `busy_ns`."""
    busy_ns: int = 10 * MS
    loss: float = 0.0
    """Probability that an observation never comes."""
    ppm: dict[int, float] = field(default_factory=dict)
    """How fast the clocks of boards are."""


@dataclass
class Own:
    """One board of the simulated robot."""

    cycle: Cycle
    boot_ns: int
    ppm: float
    incarnation: int
    lived: list[TickTrace] = field(default_factory=list)
    dead: bool = False

    def own_ns(self, now_ns: int) -> int:
        return self.boot_ns + now_ns + round(now_ns * self.ppm * 1e-6)

    def wall_ns(self, own_ns: int) -> int:
        return round((own_ns - self.boot_ns) / (1.0 + self.ppm * 1e-6))


class RealtimeRobot:
    """Plant and boards; `run` plays until the run is over."""

    def __init__(self, scenario: Scenario, host: Host | None = None) -> None:
        self.scenario = scenario
        self.host = host or Host()
        self.random = Random(self.host.seed)
        self.run_id = run_id(scenario.digest)
        config = plant_config(scenario)
        self.tick_ns = round(config.run.tick_s * 1e9)
        self.running = FreeRunning(Plant(config, run_id=self.run_id))
        self.records: list[TickRecord] = []
        self.traces: list[tuple[int, bytes]] = []
        self.complaints: list[tuple[int, str]] = []
        self.now_ns = 0
        self._agenda: list[tuple[int, int, Callable[[], None]]] = []
        self._number = 0
        self._release_ns = config.warm_up_ticks * self.tick_ns
        self.boards: list[Own | None] = [None] * len(scenario.joints)
        self.ever: list[Own] = []
        self.plugged = [0] * len(scenario.joints)
        for board in range(len(scenario.joints)):
            self.plug(board)
        self.pace = Pace(tick_s=config.run.tick_s)
        self.pace.wait_s(self.running.plant.tick, 0.0)
        self._at(0, self._tick)

    def run(self) -> tuple[list[TickRecord], Outcome]:
        while not self.running.plant.over:
            self.now_ns, _, act = heappop(self._agenda)
            act()
        for board, own in enumerate(self.boards):
            if own is not None:
                self._trace(board, own, own.cycle.rest())
        return self.records, self.running.plant.outcome((self.now_ns - self._release_ns) * 1e-9)

    def plug(self, board: int) -> None:
        self.plugged[board] += 1
        incarnation = self.plugged[board]
        config = board_config(self.scenario, self.scenario.joints[board])
        firmware = assemble_on_own_time(config, run_id=self.run_id, incarnation=incarnation)
        cycle = Cycle(firmware, config)
        boot_ns = self.random.randrange(10**12)
        own = Own(cycle, boot_ns, self.host.ppm.get(board, 0.0), incarnation)
        self.boards[board] = own
        self.ever.append(own)
        self.running.plant.admit(board, incarnation)

    def unplug(self, board: int) -> None:
        """Kill a board: what it has lived through of late, nobody will know."""
        own = self.boards[board]
        assert own is not None
        own.dead = True
        self.boards[board] = None
        self.running.remove(board, "died")

    def spool(self) -> Spool:
        """Play to the end; what a recording of it would hold."""
        records, outcome = self.run()
        pace = self.pace
        account = {"behind_ms_max": pace.behind_s_max * 1e3, "slipped_s": pace.slipped_s}
        realtime: list[tuple[int, Any]] = [*self.traces, (PLANT, account)]
        walls: list[TickWallTimes | None] = [None] * len(records)
        return Spool(
            self.scenario,
            {},
            records,
            walls,
            [],
            outcome,
            complete=True,
            realtime=tuple(realtime),
        )

    def lived(self, board: int) -> list[TickTrace]:
        own = self.boards[board]
        assert own is not None
        return own.lived

    def _at(self, when_ns: int, act: Callable[[], None]) -> None:
        heappush(self._agenda, (when_ns, self._number, act))
        self._number += 1

    def _any(self, bounds_ns: tuple[int, int]) -> int:
        return self.random.randrange(*bounds_ns)

    def _tick(self) -> None:
        running = self.running
        match running.plant.begin():
            case Unplug(board):
                self.unplug(board)
            case Plug(board):
                self.plug(board)
        for board, payload in running.open():
            if self.random.random() >= self.host.loss:
                self._send(self._any(self.host.latency_ns), self._observe, board, payload)
        self.records.append(running.close())
        spent_ns = self._any(self.host.plant_ns)
        if self.random.random() < self.host.stall:
            spent_ns += self.random.randrange(self.host.busy_ns)
        now_ns = self.now_ns + spent_ns
        self._at(
            now_ns + round(self.pace.wait_s(running.plant.tick, now_ns * 1e-9) * 1e9), self._tick
        )

    def _send(self, after_ns: int, take: Any, *what: Any) -> None:
        self._at(self.now_ns + after_ns, lambda: take(*what))

    def _observe(self, board: int, payload: bytes) -> None:
        own = self.boards[board]
        if own is None:
            return
        starts = own.cycle.next_ns is None
        try:
            own.cycle.observed(payload, own.own_ns(self.now_ns))
        except (AnsweredError, ProtocolError):
            return
        if starts:
            self._sleep(board, own)

    def _sleep(self, board: int, own: Own) -> None:
        assert own.cycle.next_ns is not None
        wake_ns = max(self.now_ns, own.wall_ns(own.cycle.next_ns) + 1) + self._any(
            self.host.wake_ns
        )
        if self.random.random() < self.host.busy:
            wake_ns += self.random.randrange(self.host.busy_ns)
        self._at(wake_ns, lambda: self._wake(board, own))

    def _wake(self, board: int, own: Own) -> None:
        if own.dead:
            return
        turn = own.cycle.wake(own.own_ns(self.now_ns))
        assert turn is not None
        spent_ns = 0
        for slot in turn.slots:
            spent_ns += self._any(self.host.turn_ns)
            said = own.cycle.board.play(slot)
            for near, payload in zip(
                own.cycle.board.board.config.neighbours, said.links, strict=True
            ):
                self._send(
                    spent_ns + self._any(self.host.latency_ns), self._hear, board, near, payload
                )
            self._send(
                spent_ns + self._any(self.host.latency_ns),
                self._answer, board, own.incarnation, said.torque,
            )  # fmt: skip
            self._trace(board, own, own.cycle.said(slot, own.own_ns(self.now_ns + spent_ns)))
        self.traces += ((board, word) for word in own.cycle.last_words())
        line = own.cycle.turned(own.own_ns(self.now_ns + spent_ns), spent_ns)
        if line is not None:
            self.complaints.append((board, line))
        self.now_ns += spent_ns
        self._sleep(board, own)
        self.now_ns -= spent_ns

    def _hear(self, sender: int, receiver: int, payload: bytes) -> None:
        own = self.boards[receiver]
        if own is not None:
            own.cycle.board.hear(own.cycle.board.board.config.neighbours.index(sender), payload)

    def _answer(self, board: int, incarnation: int, payload: bytes) -> None:
        if self.running.plant.roster.incarnations[board] == incarnation:
            self.running.answer(board, payload)

    def _trace(self, board: int, own: Own, payload: bytes | None) -> None:
        if payload is not None:
            self.traces.append((board, payload))
            own.lived += decode_trace(payload).lived
