"""What a terminal can ask of a running robot, and what it is refused, with the reason."""

import json
import random
from typing import Any
from zlib import decompress

import msgpack
import pytest

from plant_server.session.control import ONE_WAY_AFTER_TICKS, STATUS, answer
from plant_server.session.lockstep import Lockstep
from protocol.robot.events import (
    Command,
    LinkChange,
    LinkParameters,
    LinkRepair,
    Plug,
    Push,
    ReferenceChange,
    Unplug,
    values_of,
)
from protocol.robot.states import Counters, State
from protocol.wire.frames import VERSION, LinkUse, TorqueFrame, encode, seal
from tests.plant_server.plant import (
    ANKLE,
    HIP,
    JOINTS,
    KNEE,
    finish,
    happened,
    opened,
    plant,
    play,
    reply,
    torque_frame,
)


def ask(lockstep: Lockstep, request: object, version: object = VERSION) -> dict[str, Any]:
    """Ask as the command line does; anything but the status is a command in JSON."""
    content = request if request == STATUS else json.dumps(request, default=values_of)
    return asked(lockstep, seal(msgpack.packb((version, content))))


def asked(lockstep: Lockstep, payload: bytes) -> dict[str, Any]:
    said = json.loads(decompress(answer(lockstep, list(JOINTS), payload)))
    assert isinstance(said, dict)
    return said


COMMANDS: list[Command] = [
    LinkChange(((0, 1), (1, 0)), {"cut": 1.0}),
    LinkChange((), {"loss": 0.2, "delay_ticks": 5}),
    LinkRepair(()),
    ReferenceChange(2, 0.1),
    Push(2, 40.0, 100),
    Unplug(1),
]


@pytest.mark.parametrize("command", COMMANDS, ids=str)
def test_a_command_takes_effect_in_the_tick_that_is_named(command: Command) -> None:
    """And in no other, in the open tick least of all (S15)."""
    lockstep = plant()
    play(lockstep)
    opened(lockstep)
    assert ask(lockstep, command) == {"tick": 2}
    assert finish(lockstep).events == ()
    assert command in play(lockstep).events
    assert command not in play(lockstep).events


def test_commands_given_at_once_are_told_each_its_own_tick() -> None:
    lockstep = plant(events=[(1, Push(HIP, 1.0, 1))])
    opened(lockstep)
    told = [ask(lockstep, Push(HIP, force, 1))["tick"] for force in (2.0, 3.0, 4.0)]
    assert told == [2, 3, 4]
    finish(lockstep)
    begun = {}
    for tick in range(1, 6):
        for _, force_n, _ in happened(play(lockstep), "push"):
            begun[force_n] = tick
    assert begun == {1.0: 1, 2.0: 2, 3.0: 3, 4.0: 4}


REFUSED: list[tuple[object, str]] = [
    (Plug(1), "knee is plugged in already"),
    (Unplug(2), "hip is not plugged in"),
    (ReferenceChange(2, 0.1), "hip is not plugged in"),
    (Unplug(3), "there is no board 3; the body has ankle, knee, hip"),
    (Push(-1, 40.0, 100), "push: link: expected int >= 0"),
    (Push(2, 40.0, 0), "push: ticks: expected int >= 1"),
    (Push(2, 1e9, 10), "push: force_n: expected float <= 10000.0"),
    (Push(2, float("nan"), 10), "push: force_n: expected float"),
    (ReferenceChange(1, 9.0), "reference: reference_rad: expected float <= 3.2"),
    (ReferenceChange(1, float("nan")), "reference: reference_rad: expected float"),
    (LinkChange(((0, 2),), {"cut": 1.0}), "ankle and hip have no link"),
    (["link", [[0, 1]], {"cuts": 1.0}], "link: a link has no 'cuts'; it has loss"),
    (["link", [[0, 1]], {"loss": 1.5}], "link: loss: expected float <= 1.0"),
    (["link", [[0, 1]], {"loss": float("nan")}], "link: loss: expected float"),
    (["link", [[0, 1]], {"delay_ticks": 1.5}], "link: delay_ticks: expected float that's a multi"),
    (["link", [[0, 1]], {"loss": "much"}], "link: changes: expected float, got str"),
    (["link", [[0, 1]], {}], "link: changes: expected object of length >= 1"),
    (["link", [[0]], {"cut": 1.0}], "link: pairs: expected array of length 2, got 1"),
    (["sensor", 1, "encoder", "drunk", 0.0, 0], "sensor: fault: invalid enum value 'drunk'; there"),
    (["ready", 1], "there is no 'ready'; there are link, heal"),
    (["dance"], "there is no 'dance'; there are link, heal"),
    ([], "not [what, ...]: []"),
    (7, "not [what, ...]: 7"),
    ({"do": "cut"}, "not [what, ...]: {'do': 'cut'}"),
]


@pytest.mark.parametrize(("command", "reason"), REFUSED, ids=str)
def test_a_command_that_cannot_take_effect_is_refused_with_its_reason(
    command: object, reason: str
) -> None:
    """There is no hip, and nothing is on the agenda after it."""
    lockstep = plant(here=(ANKLE, KNEE))
    play(lockstep)
    said = ask(lockstep, command)
    assert set(said) == {"refused"}
    assert said["refused"].startswith(reason)
    assert all(play(lockstep).events == () for _ in range(3))


def test_a_command_for_after_the_end_is_refused() -> None:
    lockstep = plant(ticks=3)
    opened(lockstep)
    assert ask(lockstep, Push(HIP, 1.0, 1)) == {"tick": 1}
    assert ask(lockstep, Push(HIP, 1.0, 1)) == {"tick": 2}
    assert ask(lockstep, Push(HIP, 1.0, 1)) == {"refused": "the run is over at tick 3"}


@pytest.mark.parametrize("request_", [STATUS, LinkRepair(())], ids=str)
@pytest.mark.parametrize("version", [VERSION + 1, 0, "1", None], ids=str)
def test_another_version_is_refused_whatever_it_asks(version: object, request_: object) -> None:
    lockstep = plant()
    said = ask(lockstep, request_, version)
    assert said == {"refused": f"this plant speaks version {VERSION}, not {version}"}
    assert not happened(play(lockstep), "heal")


def garbage() -> list[bytes]:
    chance = random.Random(5)
    sealed: list[object] = [
        (),
        (VERSION,),
        (VERSION, STATUS, 1),
        (VERSION, None),
        (VERSION, 3.5),
        (VERSION, ["status"]),
        (VERSION, {"a": 1}),
        (VERSION, b"\xff\xfe"),
        (VERSION, "Status"),
        (VERSION, "{"),
        (VERSION, "[" * 200),
        (VERSION, '["push", 0, 1e999, 1]'),
        (VERSION, f'["push", 0, 1.0, {"9" * 200}]'),
        (VERSION, '["reference", 0, null]'),
        (VERSION, '["link", [[0, 1]], {"loss": null}]'),
        (VERSION, '["link", null, {"loss": 0.1}]'),
        "status",
    ]
    return [
        b"",
        bytes(300),
        *(seal(msgpack.packb(content)) for content in sealed),
        *(chance.randbytes(chance.randint(1, 256)) for _ in range(300)),
        *(seal(chance.randbytes(chance.randint(1, 200))) for _ in range(300)),
    ]


def test_garbage_is_refused_and_harms_nobody() -> None:
    lockstep = plant()
    play(lockstep)
    for payload in garbage():
        opened(lockstep)
        said = asked(lockstep, payload)
        assert set(said) == {"refused"}
        assert said["refused"]
        assert finish(lockstep).events == ()


def test_the_status_tells_of_boards_and_of_whom_the_plant_waits_for() -> None:
    lockstep = plant()
    assert [board["state"] for board in ask(lockstep, STATUS)["boards"]] == ["enrolling"] * 3
    play(lockstep, 7.0, 8.0, 9.0)
    lockstep.remove(HIP, "died")
    play(lockstep, 7.0, 8.0)
    lockstep.remove(KNEE, "died")
    lockstep.plant.admit(KNEE, 2)
    opened(lockstep)
    reply(lockstep, KNEE, 0.0, State.SYNCING)
    status = ask(lockstep, STATUS)
    assert (status["tick"], status["tick_s"]) == (2, 1e-3)
    assert status["waits_for"] == ["ankle"]
    assert status["sides"] == [["ankle", "knee"]]
    running = {"state": "running", "enabled": True, "torque_nm": 7.0, "controlled_rad": 0.0}
    syncing = {"state": "syncing", "enabled": True, "torque_nm": 0.0, "controlled_rad": 0.0}
    healthy = {"fault": None, "stuck": 0, "counters": Counters()._asdict()}
    assert status["boards"] == [
        {"joint": "ankle", "incarnation": 1, **healthy, **running},
        {"joint": "knee", "incarnation": 2, **healthy, **syncing},
        {"joint": "hip", "incarnation": 0, **healthy, "state": "absent", "enabled": False},
    ]
    assert status["storms"] == []


def test_the_status_tells_what_links_suffer_from() -> None:
    """Standing faults and commands; a link without has none."""
    lockstep = plant(standing={(KNEE, HIP): LinkParameters(loss=0.2)})
    ask(lockstep, LinkChange(((0, 1), (1, 0)), {"cut": 1.0}))
    play(lockstep)
    play(lockstep)
    status = ask(lockstep, STATUS)
    assert status["sides"] == [["ankle"], ["knee", "hip"]]
    faults = {(link["from"], link["to"]): link["faults"] for link in status["links"]}
    assert faults == {
        ("ankle", "knee"): {"cut": 1.0},
        ("knee", "ankle"): {"cut": 1.0},
        ("knee", "hip"): {"loss": 0.2},
        ("hip", "knee"): {},
    }


def one_way(lockstep: Lockstep) -> list[tuple[str, str]]:
    links = ask(lockstep, STATUS)["links"]
    return [(link["from"], link["to"]) for link in links if link["one_way"]]


@pytest.mark.parametrize(
    ("unheard_ticks", "noticed"),
    [(0, False), (ONE_WAY_AFTER_TICKS, False), (ONE_WAY_AFTER_TICKS + 1, True)],
)
def test_a_one_way_link_is_noticed_by_whoever_is_not_heard(
    unheard_ticks: int, *, noticed: bool
) -> None:
    """The hip hears from the knee that the knee has not heard it for long."""
    lockstep = plant()
    opened(lockstep)
    unheard: TorqueFrame = torque_frame(0, board=HIP)
    unheard = unheard._replace(links=(LinkUse(1, 0, unheard_ticks),))
    lockstep.answer(HIP, encode(unheard))
    assert one_way(lockstep) == []  # Nothing is known of the knee yet.
    finish(lockstep)
    assert one_way(lockstep) == ([("hip", "knee")] if noticed else [])
    lockstep.remove(KNEE, "died")
    assert one_way(lockstep) == []


def test_a_status_can_always_be_told() -> None:
    """Of a body that has flown apart, and of a run that has not begun."""
    lockstep = plant(here=())
    assert ask(lockstep, STATUS)["sides"] == []
    lockstep = plant()
    play(lockstep, float("nan"), 1e300, 0.0)
    assert ask(lockstep, STATUS)["boards"][0]["state"] == "running"
