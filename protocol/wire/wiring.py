"""Wiring: who listens where, who dials whom, and the Zenoh configuration that makes it so.

Peers do not relay, so the list of endpoints to dial *is* the wiring of the robot: a board has a
cable to the plant and one to each mechanical neighbour, and hears nobody else. One side of each
pair dials (zenoh issue 2806): the upper board dials the lower one, every board dials the plant.
"""

import os
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from protocol.robot.scenario import Scenario

LEASE_LOCKSTEP_MS = 3_600_000
"""A stopped process keeps its place; a killed one shows in milliseconds all the same."""
LEASE_REALTIME_MS = 400
"""A stopped process has lost its place when it has been silent for so long (S7)."""

SPARE_SESSIONS_PLANT = 16
SPARE_SESSIONS_BOARD = 4

RUNTIME_THREADS = (
    "(rx:(worker_threads:2),net:(handover:rx),acc:(handover:rx),app:(handover:rx),tx:(handover:rx))"
)
"""Two transport threads instead of five: a fifth less time per tick, and 10 MB less memory.

One would be as fast, but where it waits for a lock while a link is set up, whoever holds the lock
may need another (zenoh-c issue 1308).
"""


class Rig(NamedTuple):
    """Where one robot lives on the network: the plant on the base port, board i on base + 1 + i."""

    name: str
    host: str
    base_port: int
    boards: int
    lease_ms: int = LEASE_LOCKSTEP_MS

    def endpoint(self, port_offset: int) -> str:
        """Where the plant (offset 0) or board i (offset 1 + i) listens."""
        return f"tcp/{self.host}:{self.base_port + port_offset}"


def rig_of(scenario: Scenario) -> Rig:
    """Where the robot of a scenario lives."""
    rig = scenario.rig
    lease_ms = LEASE_LOCKSTEP_MS if scenario.realtime is None else LEASE_REALTIME_MS
    return Rig(rig.name, rig.host, rig.base_port, len(scenario.boards), lease_ms)


def network_trouble(endpoint: str, detail: str) -> str:
    """Put into one line why a process could not listen, and what to do about it."""
    if "in use" in detail:
        return (
            f"{endpoint} is in use, perhaps by another run; end that one, or choose another port"
            f" with --set rig.base_port=... for every process"
        )
    return f"cannot listen at {endpoint}: {detail}"


@cache
def neighbours(board: int, boards: int) -> tuple[int, ...]:
    """Indices of the boards that share a joint or a link with this one, from the ground up."""
    return tuple(i for i in (board - 1, board + 1) if 0 <= i < boards)


def plant_session(rig: Rig) -> dict[str, Any]:
    """Zenoh configuration of the plant: it listens, boards dial in."""
    return _config(
        listen=[rig.endpoint(0)],
        dial=[],
        sessions_max=rig.boards + SPARE_SESSIONS_PLANT,
        lease_ms=rig.lease_ms,
    )


def board_session(rig: Rig, board: int, *, listens: bool = True) -> dict[str, Any]:
    """Zenoh configuration of one board: it dials the plant and the board below."""
    dial = [rig.endpoint(0)] + ([rig.endpoint(board)] if board > 0 else [])
    degree = len(neighbours(board, rig.boards)) + 1
    return _config(
        listen=[rig.endpoint(1 + board)] if listens else [],
        dial=dial,
        sessions_max=degree + SPARE_SESSIONS_BOARD,
        lease_ms=rig.lease_ms,
    )


def elector_session(rig: Rig, board: int, near: Sequence[int]) -> dict[str, Any]:
    """Zenoh configuration of a board without a plant: it dials its neighbours of lower index."""
    return _config(
        listen=[rig.endpoint(1 + board)],
        dial=[rig.endpoint(1 + other) for other in near if other < board],
        sessions_max=len(near) + SPARE_SESSIONS_BOARD,
        lease_ms=rig.lease_ms,
    )


def terminal_session(rig: Rig) -> dict[str, Any]:
    """Zenoh configuration of whoever asks the plant something: it dials, nobody dials it."""
    return _config(listen=[], dial=[rig.endpoint(0)], sessions_max=1, lease_ms=rig.lease_ms)


def set_runtime_threads() -> None:
    """Choose how many threads Zenoh starts; must come before its first session."""
    os.environ.setdefault("ZENOH_RUNTIME", RUNTIME_THREADS)


def _config(
    *, listen: list[str], dial: list[str], sessions_max: int, lease_ms: int
) -> dict[str, Any]:
    return {
        "mode": "peer",
        "listen": {"endpoints": listen, "exit_on_failure": True},
        "connect": {
            "endpoints": dial,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "scouting": {
            "delay": 0,
            "multicast": {"enabled": False},
            "gossip": {"enabled": False},
        },
        "queries_default_timeout": 500,
        "low_pass_filter": [
            {
                "id": "mtu",
                "messages": ["put"],
                "flows": ["ingress", "egress"],
                "key_exprs": ["dec/**"],
                "size_limit": 256,
            }
        ],
        "transport": {
            "unicast": {
                "open_timeout": 300,
                "accept_timeout": 300,
                "max_links": 1,
                "max_sessions": sessions_max,
                "lowlatency": True,
                "qos": {"enabled": False},
            },
            "link": {
                "protocols": ["tcp", "unixsock-stream"],
                "tx": {
                    "lease": lease_ms,
                    "keep_alive": 4,
                    "batch_size": 2048,
                    "queue": {"congestion_control": {"block": {"wait_before_close": 50_000}}},
                },
                "rx": {"max_message_size": 4096},
            },
            "shared_memory": {"enabled": False},
        },
    }
