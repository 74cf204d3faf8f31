"""Spools as they are read back, without files or processes."""

from functools import cache

from msgspec.structs import replace

from deploy.launch.twin import run_twin
from deploy.scenario_file.load import load
from plant_server.session.record import TickRecord, TickWallTimes
from plant_server.spool.spool import Spool
from protocol.robot.scenario import LinkFaults, Scenario
from protocol.wire.timing import TickTiming, Timing
from tests.realtime.robot import MS, Host, RealtimeRobot

SHORT = {
    "paper": ("run.duration_s=0.3",),
    "bursty": ("run.duration_s=0.3",),
    "hotplug": ("event.0.at_s=0.1", "event.1.at_s=0.2", "run.duration_s=0.4"),
    "knee-out": ("event.0.at_s=0.1", "event.1.at_s=0.2", "run.duration_s=0.4"),
    "storm": (
        "event.0.at_s=0.05",
        "event.1.at_s=0.1",
        "event.2.at_s=0.15",
        "event.3.at_s=0.2",
        "event.4.at_s=0.25",
        "event.5.at_s=0.35",
        "run.duration_s=0.5",
    ),
}
"""Scenarios with their events early, so that little time shows all of them."""
FACTS = {"mode": "processes", "clock": 7, "fingerprint": "0123", "cpu_s": 1.5, "memory_kb": 2048}


@cache
def spool(name: str = "paper", *settings: str) -> Spool:
    """What a twin would leave of a short run."""
    return played(load(name, list(settings or SHORT[name])))


def played(scenario: Scenario) -> Spool:
    """What a twin would leave of any run."""
    ticks, outcome = run_twin(scenario)
    walls: list[TickWallTimes | None] = [None] * len(ticks)
    return Spool(scenario, {"mode": "twin"}, ticks, walls, [], outcome, complete=True)


@cache
def by_the_wall(*settings: str) -> Spool:
    """What a plant in realtime would leave: a busy host, bad links, a board that comes and goes."""
    mode = ["run.mode=realtime", "unattended.how=braked", *(settings or SHORT["hotplug"])]
    faults = (LinkFaults(1, 2, {"loss": 0.2, "corrupt": 0.1}),)
    scenario = replace(load("hotplug", mode), link_faults=faults)
    of = RealtimeRobot(scenario, Host(busy=0.05, busy_ns=12 * MS, loss=0.1)).spool()
    return of._replace(facts=FACTS, walls=[_walls(record) for record in of.ticks])


def bad_link(**parameters: float) -> Spool:
    """A short run whose link between knee and hip is bad from the start, both ways."""
    faults = LinkFaults(1, 2, parameters), LinkFaults(2, 1, parameters)
    return played(replace(spool().scenario, link_faults=faults))


def timed(of: Spool) -> Spool:
    """The same with invented times, as processes would have: a tick each millisecond."""
    return of._replace(
        facts=FACTS,
        walls=[_walls(record) for record in of.ticks],
        reports=[
            (board, _timing(of.ticks[first : first + 16], board))
            for first in range(0, len(of.ticks), 16)
            for board in range(len(of.ticks[0].answers))
        ],
    )


def opened_ns(tick: int) -> int:
    return 10**12 + tick * 10**6


def _walls(record: TickRecord) -> TickWallTimes:
    start = opened_ns(record.tick)
    answered = tuple(start + 500_000 + i if a else 0 for i, a in enumerate(record.answers))
    return TickWallTimes(start, answered, start + 600_000)


def _timing(records: list[TickRecord], board: int) -> Timing:
    ticks = tuple(
        TickTiming(at_us + 100, at_us + 200, at_us + 300, at_us + 10, -1)
        for at_us in range(0, 1000 * len(records), 1000)
    )
    tick = records[0].tick
    return Timing(2**31 + 5, 1, tick, opened_ns(tick), 7, 1000 * (tick + 20), 30_720 + board, ticks)
