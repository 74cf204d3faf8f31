"""Somebody else's controller: it drives its board, and whatever it does it harms no other."""

import re
from pathlib import Path

import pytest

from module_agent.assembly import assemble
from module_agent.custom import sandbox as foreign
from module_agent.firmware.board import Actuation
from module_agent.firmware.config import Source
from protocol.process.stopping import StoppedError
from protocol.robot.scenario import ScenarioError
from protocol.robot.sensors import Readings
from protocol.robot.states import FaultCode, State
from protocol.wire.frames import Fault, decode
from tests.module_agent.outside import election, servo, source, written
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    ROUNDS,
    RUN,
    Robot,
    config,
    observation,
    still,
    torque,
)

ANKLE, KNEE, HIP = range(3)
FAILS = PERIOD_TICKS + 13
"""Between two elections."""
OURS = Path(foreign.__file__).parents[1] / "firmware"
WRITTEN_OUT = "return Vote(Candidate(now.urgency, self.board), now.last)"


def mixed(board: int, *, controller: Source | None = None, rule: Source | None = None) -> Robot:
    """Three boards in a bow, one of them with something from outside."""
    robot = Robot(sensors=still)
    made = config(board, controller=controller, rule=rule)
    robot.boards[board] = assemble(made, run_id=RUN, incarnation=1)
    return robot


def failing(code: str) -> str:
    """A servo that works until it does this."""
    return f"if seen.tick >= {FAILS}: {code}\n        return -100.0 * seen.error_rad"


def report(acts: dict[int, list[Actuation]], board: int) -> tuple[int, FaultCode, str]:
    """The only report of a board: when, what, and where."""
    ((tick, payloads),) = [
        (tick, of_all[board].faults) for tick, of_all in acts.items() if of_all[board].faults
    ]
    parts = [decode(Fault, payload) for payload in payloads]
    assert [part.part for part in parts] == list(range(parts[0].parts))
    assert {part[:4] for part in parts} == {(RUN, 1, tick, parts[0].code)}
    return tick, FaultCode(parts[0].code), "".join(part.text for part in parts)


# --- A controller that works ---------------------------------------------------------------------


@pytest.mark.parametrize("board", [ANKLE, KNEE, HIP])
def test_our_own_classes_come_through_the_same_doors(board: int) -> None:
    """Named as somebody else's, they say the same bytes."""
    controller = source(OURS / "servo.py", "Servo")
    rule = source(OURS / "consensus.py", "MaxConsensus")
    named = mixed(board, controller=controller, rule=rule)
    assert named.run(3 * PERIOD_TICKS) == Robot(sensors=still).run(3 * PERIOD_TICKS)


def test_a_servo_is_told_what_its_board_knows(tmp_path: Path) -> None:
    """Error and rate of what it is to control, the body of one lumped delay ago, sensors of now."""
    body = "return seen.error_rad + 10 * seen.enabled + 100 * seen.body.joint.rad"
    robot = mixed(KNEE, controller=servo(tmp_path, body))
    acts = robot.run(PERIOD_TICKS)
    assert torque(acts[0][KNEE]).torque_nm == pytest.approx(-0.07 + 10 - 7)
    disabled = torque(acts[ROUNDS + 1][KNEE])
    assert disabled.torque_nm == pytest.approx(0.0 + 0 - 7), "it holds, so its error is 0"


def test_an_election_is_told_each_round(tmp_path: Path) -> None:
    """A board that claims more than it has wins, and all agree on it: what is said is what counts.

    It takes part in the rounds only, and its y counts at the end of the last.
    """
    body = (
        "self.asked = [*getattr(self, 'asked', []), (now.tick, now.number, now.last)]\n"
        "        if now.number == 0: self.best = Candidate(now.urgency + 1.0, self.board)\n"
        "        self.best = max([self.best, *now.heard])\n"
        "        return Vote(self.best, self.best.board == self.board)"
    )
    robot = mixed(ANKLE, rule=election(tmp_path, body))
    acts = robot.run(2 * PERIOD_TICKS)
    y = [[torque(act).enabled for act in acts[tick]] for tick in range(2 * PERIOD_TICKS)]
    assert y[:ROUNDS] == [[1, 1, 1]] * ROUNDS
    assert y[ROUNDS:] == [[1, 0, 0]] * (2 * PERIOD_TICKS - ROUNDS)
    part = robot.boards[ANKLE].election
    assert part is not None
    assert isinstance(part.rule, foreign.SandboxedRule)
    assert part.rule._theirs.asked == [
        (epoch * PERIOD_TICKS + number, number, number == ROUNDS)
        for epoch in range(2)
        for number in range(ROUNDS + 1)
    ]


def test_numbers_of_other_kinds_are_numbers(tmp_path: Path) -> None:
    """An int, a bool, a numpy scalar: what is sent is a float."""
    for answer in ("3", "True", "__import__('numpy').float32(3.0)"):
        robot = mixed(HIP, controller=servo(tmp_path, f"return {answer}"))
        assert torque(robot.run(1)[0][HIP]).torque_nm == (1.0 if answer == "True" else 3.0)


def test_each_board_has_a_memory_of_its_own(tmp_path: Path) -> None:
    """Also in what lies outside of the class: in the twin as in processes."""
    text = "count = 0\nclass Mine:\n    def __init__(self, config): pass\n"
    text += "    def torque_nm(self, seen):\n        global count\n        count += 1\n"
    counting = written(tmp_path / "my_servo.py", text + "        return count\n")
    robot = Robot(sensors=still)
    robot.boards = [
        assemble(config(i, controller=counting), run_id=RUN, incarnation=1) for i in range(3)
    ]
    acts = robot.run(5)
    assert [torque(act).torque_nm for act in acts[4]] == [5.0, 5.0, 5.0]


def test_what_lies_beside_the_file_can_be_imported(tmp_path: Path) -> None:
    (tmp_path / "gains_beside_it.py").write_text("GAIN = 7.0\n")
    body = "from gains_beside_it import GAIN\n        return GAIN"
    assert torque(mixed(HIP, controller=servo(tmp_path, body)).run(1)[0][HIP]).torque_nm == 7.0


def test_a_dataclass_may_be_a_controller(tmp_path: Path) -> None:
    """Its module has to be known to Python while it is made."""
    text = "from __future__ import annotations\nfrom dataclasses import dataclass\n"
    text += "@dataclass\nclass Mine:\n    config: object\n    gain: float = 2.0\n"
    text += "    def torque_nm(self, seen): return self.gain\n"
    robot = mixed(HIP, controller=written(tmp_path / "my_dataclass.py", text))
    assert torque(robot.run(1)[0][HIP]).torque_nm == 2.0


# --- A servo that fails --------------------------------------------------------------------------


FAILURES = [
    ("return 1.0 / 0.0", FaultCode.CONTROLLER_RAISED, "ZeroDivisionError: float division by zero"),
    ("raise SystemExit(3)", FaultCode.CONTROLLER_RAISED, "SystemExit: 3"),
    (
        "raise RuntimeError('ä\\x1b[31m')",
        FaultCode.CONTROLLER_RAISED,
        "RuntimeError: \\xe4\\x1b[31m",
    ),
    ("return self.torque_nm(seen)", FaultCode.CONTROLLER_RAISED, "RecursionError: maximum"),
    ("return float('nan')", FaultCode.CONTROLLER_NO_TORQUE, "torque_nm answered nan, which"),
    ("return float('-inf')", FaultCode.CONTROLLER_NO_TORQUE, "torque_nm answered -inf, which"),
    ("return 10 ** 400", FaultCode.CONTROLLER_NO_TORQUE, "OverflowError: int too large"),
    ("return None", FaultCode.CONTROLLER_NO_TORQUE, "torque_nm answered a NoneType, which"),
    ("return '3'", FaultCode.CONTROLLER_NO_TORQUE, "torque_nm answered a str, which"),
]


@pytest.mark.parametrize(("code", "number", "says"), FAILURES, ids=[case[0] for case in FAILURES])
def test_a_servo_that_fails_puts_its_board_out_of_action_and_no_other(
    tmp_path: Path, code: str, number: FaultCode, says: str
) -> None:
    """The hip, which is elected. It answers on, without torque, and the others elect another."""
    robot = mixed(HIP, controller=servo(tmp_path, failing(code)))
    acts = robot.run(4 * PERIOD_TICKS)
    tick, found, text = report(acts, HIP)
    assert (tick, found) == (FAILS, number)
    assert says in text.splitlines()[0]
    assert str(tmp_path) not in text, "the same on every machine"
    for tick in range(4 * PERIOD_TICKS):
        frames = [torque(act) for act in acts[tick]]
        assert len(acts[tick][HIP].links) == 1, "its frames keep flowing"
        if tick < FAILS:
            assert frames[HIP].state == State.RUNNING
            assert frames[HIP].torque_nm != 0.0
            continue
        said = frames[HIP].state, frames[HIP].torque_nm, frames[HIP].enabled
        assert said == (State.FAULT, 0.0, 0)
        assert [frame.state for frame in frames[:HIP]] == [State.RUNNING] * 2
        if tick >= 2 * PERIOD_TICKS + ROUNDS:
            assert [frame.enabled for frame in frames] == [0, 1, 0]


def test_where_it_failed_is_told_with_the_line(tmp_path: Path) -> None:
    text = "class Mine:\n    def __init__(self, config): pass\n    def torque_nm(self, seen):\n"
    text += "        return self.deeper()\n    def deeper(self):\n        raise KeyError('gain')\n"
    robot = mixed(KNEE, controller=written(tmp_path / "my_servo.py", text))
    acts = robot.run(2)
    tick, code, text = report(acts, KNEE)
    assert (tick, code) == (0, FaultCode.CONTROLLER_RAISED)
    assert text.splitlines() == [
        "KeyError: 'gain'",
        "my_servo.py:6 in deeper: raise KeyError('gain')",
        "my_servo.py:4 in torque_nm: return self.deeper()",
    ]
    fault = robot.boards[KNEE].fault
    assert fault is not None
    assert str(tmp_path / "my_servo.py") in fault.trace, "for people, with the whole path"
    assert "foreign.py" not in fault.trace


def test_a_controller_that_cannot_be_made_fails_when_it_is_first_asked(tmp_path: Path) -> None:
    """Not before: the board syncs like any other."""
    text = "class Mine:\n    def __init__(self, config): raise ValueError('no gains')\n"
    robot = mixed(KNEE, controller=written(tmp_path / "my_servo.py", text))
    acts = robot.run(3)
    assert torque(acts[-1][KNEE]).state == State.SYNCING
    assert report(acts, KNEE)[:2] == (0, FaultCode.CONTROLLER_RAISED)


def test_a_long_text_is_cut(tmp_path: Path) -> None:
    robot = mixed(HIP, controller=servo(tmp_path, failing("raise ValueError('x' * 10**6)")))
    _, _, text = report(robot.run(FAILS + 1), HIP)
    assert re.fullmatch(r"ValueError: x+", text)
    assert len(text) == 1600


def test_who_ends_the_process_is_not_kept_from_it(tmp_path: Path) -> None:
    """A signal comes in the middle of somebody's code, which may handle every Exception."""
    body = "from protocol.process.stopping import StoppedError\n"
    body += "        try: raise StoppedError\n        except Exception: return 0.0"
    hip = mixed(HIP, controller=servo(tmp_path, body)).boards[HIP]
    for tick in range(-DELAY_TICKS, 0):
        hip.tick(hip.read(observation(HIP, tick, still, waits=0)))
    with pytest.raises(StoppedError):
        hip.tick(hip.read(observation(HIP, 0, still, waits=0)))


def test_without_elections_a_failed_board_is_not_enabled_either(tmp_path: Path) -> None:
    hip = config(HIP, controller=servo(tmp_path, "return None"), election=None)
    robot = Robot(sensors=still, election=None)
    robot.boards[HIP] = assemble(hip, run_id=RUN, incarnation=1)
    assert [torque(act).enabled for act in robot.run(1)[0]] == [1, 1, 0]


# --- An election that fails ----------------------------------------------------------------------


VOTES = [
    ("raise KeyError('w')", FaultCode.ELECTION_RAISED),
    ("return None", FaultCode.ELECTION_NO_VOTE),
    ("return True", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(float('nan'), self.board), True)", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(-0.1, self.board), True)", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(2e6, self.board), True)", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(0.1, 3), True)", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(0.1, 'knee'), True)", FaultCode.ELECTION_NO_VOTE),
    ("return Vote(Candidate(0.1, self.board), 1)", FaultCode.ELECTION_NO_VOTE),
]


@pytest.mark.parametrize(("code", "number"), VOTES, ids=[case[0] for case in VOTES])
def test_the_board_in_the_middle_passes_on_what_others_say_when_its_election_fails(
    tmp_path: Path, code: str, number: FaultCode
) -> None:
    """In the very round in which it fails: the ends still agree, and exactly one is enabled."""
    fails = PERIOD_TICKS + 1
    body = f"if now.tick >= {fails}: {code}\n        if now.number == 0: self.best ="
    body += " Candidate(now.urgency, self.board)\n        self.best = max([self.best, *now.heard])"
    body += "\n        return Vote(self.best, self.best.board == self.board)"
    acts = mixed(KNEE, rule=election(tmp_path, body)).run(3 * PERIOD_TICKS)
    assert report(acts, KNEE)[:2] == (fails, number)
    for tick in range(ROUNDS, 3 * PERIOD_TICKS):
        frames = [torque(act) for act in acts[tick]]
        assert [frame.enabled for frame in frames] == [0, 0, 1], tick
        assert frames[KNEE].state == (State.FAULT if tick >= fails else State.RUNNING)
        if tick >= fails:
            assert frames[KNEE].torque_nm == 0.0
        if tick % PERIOD_TICKS >= ROUNDS:
            assert {frame.candidate for frame in frames} == {HIP}
            assert {frame.urgency for frame in frames} == {still(HIP, 0)[3]}


def test_a_board_without_sensors_may_fail_as_well(tmp_path: Path) -> None:
    """Its election is asked while it is safe; it is in fault from then on."""

    def blind(index: int, tick: int) -> Readings:
        sensed = still(index, tick)
        return sensed._replace(joint_rad=float("nan")) if index == HIP and tick > 5 else sensed

    rule = election(
        tmp_path, f"if now.tick >= {PERIOD_TICKS}: raise KeyError\n        {WRITTEN_OUT}"
    )
    robot = mixed(HIP, rule=rule)
    robot.sensors = blind
    acts = robot.run(2 * PERIOD_TICKS)
    assert torque(acts[PERIOD_TICKS - 1][HIP]).state == State.SAFE
    assert report(acts, HIP)[0] == PERIOD_TICKS
    assert torque(acts[PERIOD_TICKS][HIP]).state == State.FAULT


# --- The file ------------------------------------------------------------------------------------


def test_the_bytes_that_are_executed_are_those_of_the_hash(tmp_path: Path) -> None:
    mine = servo(tmp_path, "return 1.0")
    assert foreign.read(mine).startswith(b"\nclass Mine")
    (tmp_path / "my_servo.py").write_text("raise SystemExit")
    assert foreign.load(mine), "what was read once is kept"
    other = mine._replace(sha256="0" * 64)
    with pytest.raises(ScenarioError, match="has changed since the scenario was resolved"):
        foreign.read(other)
    gone = other._replace(path=str(tmp_path / "gone.py"))
    with pytest.raises(ScenarioError, match="cannot be read: No such file"):
        foreign.read(gone)


def test_a_file_may_be_called_like_any_module(tmp_path: Path) -> None:
    """`json.py` beside a scenario is not the library's, and does not replace it."""
    import json  # noqa: PLC0415 - the one that must stay

    mine = written(tmp_path / "json.py", "class Mine:\n    here = True\n")
    assert foreign.load(mine).here
    assert __import__("json") is json
