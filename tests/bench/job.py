"""The job that every system has to do: one plant and its boards, frames out and back, tick by tick.

In a tick the plant puts one frame to each board. A board that has it, and what its neighbours said
in the tick before, puts one frame to each neighbour and one to the plant; when the plant has them
all, the tick is over. That is the pattern of decmesh, with nothing computed.

Role 0 is the plant, 1 ... N are the boards. Every frame is 64 bytes and begins with its tick, and
a frame of another tick ends the run: a system that loses or mixes frames has not done the job.
"""

import json
import os
import statistics
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

FRAME_BYTES = 64
PLANT = 0
LOOK_EVERY_S = 0.002
PATIENCE_S = 60.0
"""How long the roles of a job wait for each other before the first tick."""


class Place(NamedTuple):
    """Where and how long a job is done; the same for all of its roles."""

    folder: Path
    port: int
    """The first of `PORTS` that are free."""
    boards: int
    warm_up: int
    ticks: int
    options: dict[str, Any]
    """What is to be done differently, by name; each system knows its own."""

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read what `write` has written."""
        port, boards, warm_up, ticks, options = json.loads((folder / "place.json").read_bytes())
        return cls(folder, port, boards, warm_up, ticks, options)

    def write(self) -> None:
        """Write it down in its folder."""
        (self.folder / "place.json").write_text(json.dumps(self[1:]))


class Endpoint(Protocol):
    """What a system gives a role: frames to and from the roles that it works with, in order."""

    def put(self, receiver: int, frame: bytes) -> None:
        """Send a frame."""

    def get(self, sender: int) -> bytes:
        """Wait for the next frame of a role."""

    def close(self) -> None:
        """Let go, when every frame of the job has come."""


def near(role: int, boards: int) -> list[int]:
    """The boards that a board shares a joint or a link with."""
    return [other for other in (role - 1, role + 1) if 1 <= other <= boards]


def partners(role: int, boards: int) -> list[int]:
    """Everybody a role exchanges frames with."""
    return list(range(1, boards + 1)) if role == PLANT else [PLANT, *near(role, boards)]


def frame_of(tick: int) -> bytes:
    """The frame of a tick."""
    return tick.to_bytes(4, "little") + bytes(FRAME_BYTES - 4)


def meet(place: Place, role: int) -> None:
    """Wait until every role can hear the others."""
    (place.folder / f"ready-{role}").touch()
    deadline = time.monotonic() + PATIENCE_S
    for other in range(place.boards + 1):
        while not (place.folder / f"ready-{other}").exists():
            if time.monotonic() > deadline:
                raise TimeoutError(f"role {other} did not come")
            time.sleep(LOOK_EVERY_S)


def work(place: Place, role: int, endpoint: Endpoint) -> None:
    """Play one role from the first tick to the last, and write down what it took."""
    write_figures(place, role, (_plant if role == PLANT else _board)(place, role, endpoint))


def write_figures(place: Place, role: int, figures: dict[str, float]) -> None:
    """Leave what a role has measured to `job_figures`."""
    (place.folder / f"figures-{role}.json").write_text(json.dumps(figures))


def _plant(place: Place, role: int, endpoint: Endpoint) -> dict[str, float]:
    boards = partners(role, place.boards)
    put, get, clock = endpoint.put, endpoint.get, time.perf_counter_ns
    stamps, cpu_s = [0] * (place.ticks + 1), 0.0
    for tick in range(place.warm_up + place.ticks):
        if tick == place.warm_up:
            cpu_s = -time.process_time() - _cpu_of_helpers_s(place)
            stamps[0] = clock()
        frame = frame_of(tick)
        for board in boards:
            put(board, frame)
        for board in boards:
            _check(get(board), frame)
        if tick >= place.warm_up:
            stamps[tick - place.warm_up + 1] = clock()
    cpu_s += time.process_time() + _cpu_of_helpers_s(place)
    return {"cpu_s": cpu_s, **tick_figures(stamps)}


def _board(place: Place, role: int, endpoint: Endpoint) -> dict[str, float]:
    neighbours = near(role, place.boards)
    put, get, cpu_s = endpoint.put, endpoint.get, 0.0
    said = b""
    for tick in range(place.warm_up + place.ticks):
        frame = frame_of(tick)
        _check(get(PLANT), frame)
        if tick == place.warm_up:
            cpu_s = -time.process_time()
        if tick > 0:
            for other in neighbours:
                _check(get(other), said)
        for other in neighbours:
            put(other, frame)
        put(PLANT, frame)
        said = frame
    for other in neighbours:
        _check(get(other), said)  # So that nobody goes before everybody has heard everything.
    return {"cpu_s": cpu_s + time.process_time()}


def _check(frame: bytes, expected: bytes) -> None:
    if frame != expected:
        ticks = [int.from_bytes(found[:4], "little") for found in (frame, expected)]
        raise RuntimeError(f"a frame of tick {ticks[0]} instead of {ticks[1]}, {len(frame)} bytes")


def tick_figures(stamps_ns: list[int]) -> dict[str, float]:
    """Rate and distribution of ticks, from the times between which they lie."""
    durations = [(b - a) / 1e3 for a, b in pairwise(stamps_ns)]
    percentiles = statistics.quantiles(durations, n=100, method="inclusive")
    return {
        "ticks_per_s": 1e9 * len(durations) / (stamps_ns[-1] - stamps_ns[0]),
        "p50_us": percentiles[49],
        "p99_us": percentiles[98],
    }


def job_figures(place: Place) -> dict[str, float]:
    """Put together what the roles wrote down; CPU time is that of all roles and helpers."""
    plant, *boards = (
        json.loads((place.folder / f"figures-{role}.json").read_bytes())
        for role in range(place.boards + 1)
    )
    cpu_s = plant.pop("cpu_s") + sum(board["cpu_s"] for board in boards)
    return {**plant, "cpu_us": 1e6 * cpu_s / place.ticks}


def _cpu_of_helpers_s(place: Place) -> float:
    """CPU time so far of processes that the system needs besides the roles, a broker for one."""
    path = place.folder / "helpers.json"
    if not path.exists():
        return 0.0
    ticks = 0
    for pid in json.loads(path.read_bytes()):
        # After the name, which may hold anything, come state, parent and so on; 11 and 12 of them.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")
