"""Rubbish on every key and port: the trajectory is the same to the bit, and nothing grows."""

import json
import random
import re
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import psutil
import pytest
import zenoh

from deploy.outcome.results import read_run
from plant_server.spool.spool import read_spool
from protocol.robot.states import COUNTERS
from protocol.wire import keys
from protocol.wire.frames import NO_TICK, LinkFrame, TorqueFrame, decode, encode, seal
from protocol.wire.timing import Timing
from protocol.wire.wiring import Rig as Address
from protocol.wire.wiring import rig_of, terminal_session
from tests.system.rig import Process, Rig, decmesh, eventually, said, twin_digest

PAYLOADS = 100_000
SETTINGS = ("run.duration_s=6",)
GROWTH_MB_MAX = 30.0
"""Far below what 100,000 kept payloads would take, far above what an allocator hoards."""


def rubbish(dice: random.Random) -> Iterator[bytes]:
    """Payloads of every bad kind, for ever."""
    real = encode(LinkFrame(1, 1, 5, 4, 0, 0, 0.5, 1, 3, *(0.1,) * 7))
    while True:
        flipped = bytearray(real)
        flipped[dice.randrange(len(real))] ^= 1 << dice.randrange(8)
        yield dice.randbytes(dice.randrange(257))
        yield real[: dice.randrange(len(real))]
        yield bytes(flipped)
        yield dice.randbytes(dice.randrange(257, 2000))
        yield b"\x91" * dice.randrange(1, 256)
        yield seal(b"\x91" * dice.randrange(1, 250))
        yield seal(dice.randbytes(dice.randrange(1, 250)))
        yield real
        yield encode(LinkFrame(1, 1, NO_TICK, 4, 0, 0, float("nan"), 1, 3, *(float("inf"),) * 7))


def every_key(rig: Rig) -> list[str]:
    name, joints = rig.scenario.rig.name, rig.scenario.joints
    return [
        *(keys.observation(name, joint) for joint in joints),
        *(keys.torque(name, joint) for joint in joints),
        *(keys.stalled(name, joint) for joint in joints),
        *(keys.report(name, joint, Timing) for joint in joints),
        *(keys.fault(name, joint) for joint in joints),
        *(keys.link(name, a, b) for a in joints for b in joints if a != b),
        keys.end(name),
    ]


def attacker(address: Address) -> zenoh.Session:
    """A session with a cable to everybody."""
    config = terminal_session(address)
    config["connect"]["endpoints"] = [address.endpoint(i) for i in range(1 + address.boards)]
    config["transport"]["unicast"]["max_sessions"] = 10
    del config["low_pass_filter"]
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def wait_until_heard(session: zenoh.Session, wanted: list[str]) -> None:
    """Until every one of these keys has a subscriber that the attacker reaches."""
    for key in wanted:
        publisher = session.declare_publisher(key)

        def is_heard(publisher: Any = publisher) -> bool:
            return bool(publisher.matching_status.matching)

        eventually(is_heard)


def resident_mb(process: Process) -> float:
    return psutil.Process(process.pid).memory_info().rss / 2**20


def counted(answers: list[bytes]) -> dict[str, int]:
    """The last count of each counter in a board's torque frames."""
    frames = [decode(TorqueFrame, answer) for answer in answers]
    return {COUNTERS[frame.counter]: frame.counted for frame in frames}


def test_rubbish_on_every_key_changes_nothing(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(*SETTINGS)
    plant = rig.plant("--progress", "--spool", str(rig.folder / "run.spool"))
    boards = [rig.board(joint) for joint in rig.scenario.joints]
    eventually(lambda: said(plant))
    processes = [plant, *boards]
    before = [resident_mb(process) for process in processes]
    payloads, everywhere = rubbish(random.Random(1)), every_key(rig)
    with attacker(rig_of(rig.scenario)) as session:
        name = rig.scenario.rig.name
        wait_until_heard(session, [keys.observation(name, joint) for joint in rig.scenario.joints])
        wait_until_heard(session, list(map(partial(keys.torque, name), rig.scenario.joints)))
        for i in range(PAYLOADS):
            session.put(everywhere[i % len(everywhere)], next(payloads))
            if i % 500 == 0:
                for key in (keys.ENROL, keys.control(name)):
                    session.get(key, payload=next(payloads), timeout=0.5)
        after = [resident_mb(process) for process in processes if process.poll() is None]
    assert [process.wait(120) for process in processes] == [0, 0, 0, 0], said(plant)
    assert not any("Traceback" in said(process) for process in processes)
    for was, now in zip(before, after, strict=False):
        assert now - was < GROWTH_MB_MAX
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest(*SETTINGS)


def test_silent_and_chattering_connections_do_not_keep_anybody_out(
    make_rig: Callable[..., Rig],
) -> None:
    """300 that say nothing, and some that say rubbish, on the plant's port and on a board's."""
    rig = make_rig("run.duration_s=0.3")
    address = rig.scenario.rig
    plant = rig.plant("--progress", "--spool", str(rig.folder / "run.spool"))
    eventually(lambda: "waiting for" in said(plant))
    dice = random.Random(2)
    silent = [socket.create_connection((address.host, address.base_port)) for _ in range(300)]
    stop = threading.Event()

    def chatter() -> None:
        while not stop.is_set():
            try:
                with socket.create_connection((address.host, address.base_port)) as loud:
                    loud.sendall(dice.randbytes(500))
            except OSError:
                pass
            stop.wait(0.02)

    thread = threading.Thread(target=chatter)
    thread.start()
    try:
        boards = [rig.board(joint) for joint in rig.scenario.joints]
        assert [process.wait(60) for process in (plant, *boards)] == [0, 0, 0, 0]
    finally:
        stop.set()
        thread.join()
        for connection in silent:
            connection.close()
    run = read_run(rig.folder)
    assert run is not None
    assert run.state_sha256 == twin_digest("run.duration_s=0.3")


@pytest.mark.parametrize("joint", ["knee"])
def test_boards_count_what_they_refuse(make_rig: Callable[..., Rig], joint: str) -> None:
    """Each reason by itself, in the telemetry that is part of the run."""
    rig = make_rig("run.duration_s=3")
    spool = rig.folder / "run.spool"
    plant = rig.plant("--progress", "--spool", str(spool))
    boards = [rig.board(name) for name in rig.scenario.joints]
    eventually(lambda: said(plant))
    name = rig.scenario.rig.name
    with attacker(rig_of(rig.scenario)) as session:
        wait_until_heard(session, [keys.link(name, "hip", joint)])
        for _ in range(50):
            session.put(keys.link(name, "hip", joint), b"rubbish")
            session.put(keys.link(name, "hip", joint), seal(b"\xc0"))
            session.put(keys.link(name, "hip", joint), b"")
    assert [process.wait(60) for process in (plant, *boards)] == [0, 0, 0, 0]
    answers = [record.answers[1] for record in read_spool(spool).ticks]
    counts = counted(answers)
    assert counts["refused_corrupt"] > 0
    assert counts["refused_malformed"] > 0
    assert counts["refused_size"] > 0


def test_a_storm_is_flagged_by_whoever_it_hits(make_rig: Callable[..., Rig]) -> None:
    """Frames by the thousand on a board's link and on the plant's key: one line each, and the
    status shows both. The hip is stopped meanwhile, so the storm need not outrun any ticks."""
    rig = make_rig("run.duration_s=600")
    plant = rig.plant("--progress")
    boards = {joint: rig.board(joint) for joint in rig.scenario.joints}
    eventually(lambda: said(plant))
    address = rig.scenario.rig
    name, port = address.name, address.base_port
    to_knee, to_plant = keys.link(name, "hip", "knee"), keys.torque(name, "hip")
    over = threading.Event()

    def rage(session: zenoh.Session) -> None:
        while not over.is_set():
            for _ in range(100):
                session.put(to_knee, b"rubbish")
                session.put(to_plant, b"rubbish")

    def shown() -> dict[str, str]:
        found = decmesh("status", "--json", "--rig", f"127.0.0.1:{port}").stdout
        return {storm["origin"]: storm["reason"] for storm in json.loads(found)["storms"]}

    with attacker(rig_of(rig.scenario)) as session:
        wait_until_heard(session, [to_knee, to_plant])
        boards["hip"].send_signal(signal.SIGSTOP)
        raging = threading.Thread(target=rage, args=(session,))
        raging.start()
        try:
            eventually(lambda: "knee: a storm: " in said(boards["knee"]))
            eventually(lambda: "plant: a storm: " in said(plant))
            assert re.search(r"[\d,]+ frames of hip a second are refused", said(boards["knee"]))
            assert re.search(r"[\d,]+ frames of hip a second are refused", said(plant))
            eventually(lambda: shown().get("frames of hip") == "corrupt")
        finally:
            over.set()
            raging.join()
            boards["hip"].send_signal(signal.SIGCONT)
    assert said(boards["ankle"]).count("a storm") == 0
    eventually(lambda: shown() == {}, patience_s=60.0)
