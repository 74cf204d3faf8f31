"""A board whose requests are not answered opens its session anew, in both modes."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import zenoh

from protocol.wire.wiring import plant_session, rig_of
from tests.system.rig import Rig, eventually


@contextmanager
def deaf_plant(rig: Rig) -> Iterator[zenoh.Session]:
    """Somebody who sits at the plant's port, and answers nothing."""
    config = plant_session(rig_of(rig.scenario))
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        yield session


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_the_plant_that_does_answer_lets_it_in(make_rig: Callable[..., Rig], mode: str) -> None:
    """Another session is another peer; the joint is the same board's all the while."""
    heavy = [f"board.{board}.link.inertia_kg_m2=1e5" for board in range(3)]
    rig = make_rig(f"run.mode={mode}", "realtime.rate_hz=100", "run.duration_s=0.2", *heavy)
    knee = rig.board("knee")
    with deaf_plant(rig) as session:
        seen = set[str]()

        def seen_twice() -> bool:
            seen.update(map(str, session.info.peers_zid()))
            return len(seen) > 1

        eventually(seen_twice)
    assert knee.poll() is None
    others = [rig.plant(), rig.board("ankle"), rig.board("hip")]
    assert [process.wait(60) for process in (knee, *others)] == [0, 0, 0, 0]
