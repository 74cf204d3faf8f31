"""One role of the job on one system: `python -m tests.bench.peers SYSTEM ROLE FOLDER`."""

import importlib
import sys
from pathlib import Path

from tests.bench import job, knobs


def main() -> None:
    """Play one role."""
    system, role, folder = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
    place = job.Place.read(folder)
    knobs.turn(place.options, role, 1 + place.boards)
    module = importlib.import_module(f"tests.bench.peers.{system}")
    endpoint: job.Endpoint = module.open_endpoint(place, role)
    try:
        job.meet(place, role)
        job.work(place, role, endpoint)
    finally:
        endpoint.close()


if __name__ == "__main__":
    main()
