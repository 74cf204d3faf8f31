"""The same job on other systems, and decmesh doing all of its work in between."""

from functools import partial

from tests.bench.ours import ON, lockstep
from tests.bench.registry import Contender, Figures, Group, Ratio, Settings
from tests.bench.systems import SYSTEMS, System, do_job

BEATEN = ("HELICS", "dora-rs", "MQTT, mosquitto", "CycloneDDS")
"""What decmesh, with everything on, means to be faster than with nothing computed."""


def group(settings: Settings) -> Group:
    """One plant and three boards, 64 bytes out and back and to each neighbour, a barrier a tick."""

    def job(system: System) -> Figures:
        return do_job(system, warm_up=settings.warm_up, ticks=settings.ticks)

    return Group(
        "systems",
        "the same messages on other systems, nothing computed, ticks/s",
        [
            *(Contender(system.name, partial(job, system)) for system in SYSTEMS),
            Contender(ON, partial(lockstep, settings, recorded=True)),
        ],
        [Ratio(f"decmesh, of {name}", ON, name, "ticks_per_s") for name in BEATEN],
    )
