"""One digest of all that must be the same, and of nothing else (S20)."""

from typing import Any

import pytest
from msgspec.structs import replace

from deploy.recording.logical_digest import logical_sha256
from protocol.robot.events import Push
from protocol.robot.scenario import RigSettings
from protocol.robot.states import COUNTERS
from protocol.wire.frames import TorqueFrame, decode, encode
from tests.deploy.spools import SHORT, opened_ns, spool, timed


def test_it_is_the_same_for_the_same_run_and_differs_for_others() -> None:
    digests = [logical_sha256(spool(name)) for name in SHORT]
    assert digests == [logical_sha256(spool(name)) for name in SHORT]
    assert len(set(digests)) == len(SHORT)


def test_clocks_hosts_and_places_have_no_part_in_it() -> None:
    of = spool("storm")
    assert of.outcome is not None
    rig = RigSettings(name="other", host="::1", base_port=1024)
    scenario = replace(of.scenario, rig=rig)
    other = timed(of)._replace(scenario=scenario, outcome=of.outcome._replace(wall_s=9.0))
    assert opened_ns(0) > 0
    assert logical_sha256(other) == logical_sha256(of)


def counted(counter: str, tick: int) -> str:
    """The digest when the knee has counted one more in a tick in which it tells that counter."""
    of = spool()
    ticks = list(of.ticks)
    record = ticks[tick]
    ankle, knee, hip = record.answers
    frame = decode(TorqueFrame, knee)
    assert COUNTERS[frame.counter] == counter
    answers = (ankle, encode(frame._replace(counted=frame.counted + 1)), hip)
    ticks[tick] = record._replace(answers=answers)
    return logical_sha256(of._replace(ticks=ticks))


def test_what_a_network_brought_has_no_part_in_it() -> None:
    counters = {decode(TorqueFrame, spool().ticks[i].answers[1]).counter: i for i in range(14)}
    for counter, tick in counters.items():
        name = COUNTERS[counter]
        same = counted(name, tick) == logical_sha256(spool())
        assert same == name.startswith("refused_"), name


@pytest.mark.parametrize(
    "change",
    [
        {"angles_rad": (0.0, 0.0, 1e-300)},
        {"rates_rad_s": (0.0, 0.0, 1e-300)},
        {"torques_nm": (0.0, 0.0, 1e-300)},
        {"answers": (b"", b"", b"")},
        {"events": (Push(0, 1.0, 1),)},
    ],
)
def test_everything_else_has(change: dict[str, Any]) -> None:
    of = spool()
    ticks = list(of.ticks)
    ticks[100] = ticks[100]._replace(**change)
    assert logical_sha256(of._replace(ticks=ticks)) != logical_sha256(of)


def test_so_has_how_it_ended() -> None:
    of = spool()
    assert of.outcome is not None
    digests = {
        logical_sha256(of._replace(outcome=outcome))
        for outcome in (of.outcome, None, of.outcome._replace(ending="fell"))
    }
    assert len(digests) == 3
