"""Which systems do the job, what each needs, and how its processes are started."""

import json
import shutil
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, NamedTuple

from deploy.launch.rigs import claim
from tests.bench.children import Children, UnavailableError
from tests.bench.hanging import hanging
from tests.bench.job import Place, job_figures, partners

ROLES = [sys.executable, "-m", "tests.bench.peers"]


class System(NamedTuple):
    """A way to pass frames between processes."""

    name: str
    module: str
    """In `tests.bench.peers`."""
    distribution: str | None = None
    """What has to be installed from the Python Package Index."""
    program: str | None = None
    """What has to be on the path."""
    options: Mapping[str, Any] = MappingProxyType({})

    def missing(self) -> str | None:
        """Why it cannot be run here, if it cannot."""
        if self.distribution is not None and self.version() is None:
            return f"{self.distribution} is not installed; pip install {self.distribution}"
        if self.program is not None and shutil.which(self.program) is None:
            return f"there is no program {self.program} on the path"
        return None

    def version(self) -> str | None:
        """Which version is installed."""
        try:
            return version(self.distribution or "decmesh")
        except PackageNotFoundError:
            return None


AS_IT_COMES = System("bare Zenoh as it comes", "bare_zenoh", "eclipse-zenoh")
UNPLACED = System(
    "bare Zenoh, our settings, on any core",
    "bare_zenoh",
    "eclipse-zenoh",
    options={"tuned": True},
)
OUR_SETTINGS = System(
    "bare Zenoh, our settings",
    "bare_zenoh",
    "eclipse-zenoh",
    options={"tuned": True, "cores": "in-turn"},
)
SYSTEMS = [
    System("Unix sockets", "unix_sockets"),
    System("shared memory, semaphores", "shared_memory"),
    System("pyzmq ipc", "zeromq", "pyzmq"),
    System("LCM", "lcm_multicast", "lcm"),
    System("CycloneDDS", "cyclone_dds", "cyclonedds"),
    System("MQTT, mosquitto", "mqtt", "paho-mqtt", "mosquitto"),
    System("dora-rs", "dora_rs", "dora-rs", "dora"),
    System("HELICS", "helics_cosim", "helics", "helics_broker"),
    AS_IT_COMES,
    OUR_SETTINGS,
]


def do_job(
    system: System,
    *,
    warm_up: int,
    ticks: int,
    boards: int = 3,
    options: dict[str, Any] | None = None,
    within_s: float = 100.0,
) -> dict[str, float]:
    """Have a system do the job once; return its figures.

    Raises `UnavailableError`, or `ChildFailedError` when it does not come to an end.
    """
    missing = system.missing()
    if missing is not None:
        raise UnavailableError(missing)
    with (
        TemporaryDirectory(prefix="decmesh-bench-") as name,
        claim(hanging(boards), Path(name)) as placed,
        Children(Path(name)) as children,
    ):
        port = placed.rig.base_port
        place = Place(
            Path(name), port, boards, warm_up, ticks, {**system.options, **(options or {})}
        )
        place.write()
        children.wait(_start(system, place, children), within_s)
        return job_figures(place)


def _start(system: System, place: Place, children: Children) -> list[str]:
    """Start helpers and roles; return the names of those that end when the job is done."""
    folder = str(place.folder)
    command = [*ROLES, system.module]
    helpers: list[int] = []
    if system.program == "mosquitto":
        settings = f"listener {place.port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n"
        (place.folder / "mosquitto.conf").write_text(settings)
        broker = ["mosquitto", "-c", str(place.folder / "mosquitto.conf")]
        helpers.append(children.start("broker", broker).pid)
    elif system.program == "helics_broker":
        broker = ["helics_broker", f"--federates={place.boards + 1}", "--coretype=zmq"]
        broker += [f"--port={place.port}", "--local_interface=tcp://127.0.0.1"]
        helpers.append(children.start("broker", broker).pid)
    elif system.program == "dora":
        (place.folder / "dataflow.yml").write_text(_dataflow(place, command))
        daemon = children.start("daemon", ["dora", "run", str(place.folder / "dataflow.yml")])
        (place.folder / "helpers.json").write_text(json.dumps([daemon.pid]))
        return ["daemon"]
    (place.folder / "helpers.json").write_text(json.dumps(helpers))
    names = [f"role-{role}" for role in range(place.boards + 1)]
    for role, role_name in enumerate(names):
        children.start(role_name, [*command, str(role), folder])
    return names


def _dataflow(place: Place, command: list[str]) -> str:
    """Write the dataflow in YAML; `command` starts a role when its number and folder are added."""
    nodes = []
    for role in range(place.boards + 1):
        others = partners(role, place.boards)
        arguments = " ".join([*command[1:], str(role), str(place.folder)])
        nodes.append(
            f"  - id: role_{role}\n    path: {command[0]}\n    args: {arguments}\n    inputs:\n"
            + "".join(
                f"      from_{other}:\n        source: role_{other}/to_{role}\n"
                f"        queue_size: 100\n"
                for other in others
            )
            + "    outputs:\n"
            + "".join(f"      - to_{other}\n" for other in others)
        )
    return "nodes:\n" + "".join(nodes)
