"""Controllers from outside, as a scenario names them: found, tried, hashed, and run."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from deploy.launch.twin import run_twin
from deploy.outcome.summary import summary
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from protocol.robot.events import BoardFault
from protocol.robot.scenario import ScenarioError
from protocol.robot.states import FaultCode
from tests.module_agent.outside import ELECTION, SERVO

WORKS = SERVO.format(body="return -100.0 * seen.error_rad")
VOTES = ELECTION.format(body="return Vote(Candidate(now.urgency, self.board), True)")
SHORT = "run.duration_s=0.3"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a scenario, a servo and an election."""
    (tmp_path / "mine.toml").write_text('extends = "paper"\n', encoding="utf-8")
    (tmp_path / "my_servo.py").write_text(WORKS, encoding="utf-8")
    (tmp_path / "my_election.py").write_text(VOTES, encoding="utf-8")
    return tmp_path


def mine(folder: Path, *settings: str, lines: str = "") -> Trajectory:
    text = f'{lines}\nextends = "paper"\n'
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    scenario = load(str(folder / "mine.toml"), [*settings, SHORT])
    return trajectory(scenario, *run_twin(scenario))


def complaints(folder: Path, *settings: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(str(folder / "mine.toml"), list(settings))
    return [
        line.removeprefix(f"{folder / 'mine.toml'}: ") for line in str(caught.value).splitlines()
    ]


def classes(folder: Path, *settings: str, lines: str = "") -> tuple[list[str | None], str | None]:
    """Of each board, and of the election."""
    text = f'extends = "paper"\n{lines}\n'
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    scenario = load(str(folder / "mine.toml"), list(settings))
    *servos, rule = [
        None if named is None else named.reference
        for named in (*(board.controller for board in scenario.boards), scenario.election.rule)
    ]
    return servos, rule


# --- What a scenario may say ---------------------------------------------------------------------

MINE, THEIRS = "my_servo:Mine", "my_election:Mine"


def test_nothing_said_is_ours() -> None:
    scenario = load("paper")
    assert [board.controller for board in scenario.boards] == [None] * 3
    assert scenario.election.rule is None
    assert scenario.rig.sources == {}


@pytest.mark.parametrize(
    ("lines", "servos"),
    [
        (f'controller = "{MINE}"', [MINE] * 3),
        (f'[controller]\nhip = "{MINE}"', [None, None, MINE]),
        (f'controller = {{ankle = "{MINE}", knee = "{MINE}"}}', [MINE, MINE, None]),
    ],
)
def test_a_servo_is_for_all_boards_or_for_some(
    folder: Path, lines: str, servos: list[str | None]
) -> None:
    assert classes(folder, lines=lines) == (servos, None)


def test_a_boards_own_word_comes_first(folder: Path) -> None:
    (folder / "other.py").write_text(WORKS, encoding="utf-8")
    found = classes(folder, "board.1.controller=other:Mine", lines=f'controller = "{MINE}"')
    assert found == ([MINE, "other:Mine", MINE], None)


@pytest.mark.parametrize(
    ("lines", "settings"),
    [
        (f'election = "{THEIRS}"', ()),
        (f'[election]\nrule = "{THEIRS}"', ()),
        ("", (f"election={THEIRS}",)),
        ("", (f"election.rule={THEIRS}",)),
    ],
)
def test_an_election_has_one_spelling_and_a_short_one(
    folder: Path, lines: str, settings: tuple[str, ...]
) -> None:
    """The short one leaves the rest of the table as it is, also of a file that is extended."""
    (folder / "slow.toml").write_text('extends = "paper"\n[election]\nperiod_s = 0.2\n')
    (folder / "mine.toml").write_text(f'extends = "{folder}/slow.toml"\n{lines}\n')
    election = load(str(folder / "mine.toml"), list(settings)).election
    assert election.rule is not None
    assert election.rule.reference == THEIRS
    assert election.period_ticks == 200


def test_a_file_is_found_beside_the_scenario_that_names_it(folder: Path) -> None:
    """Also when another one, in another folder, builds on that."""
    (folder / "mine.toml").write_text(f'controller = "{MINE}"\nextends = "paper"\n')
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "more.toml").write_text(f'extends = "{folder}/mine.toml"\n')
    scenario = load(str(elsewhere / "more.toml"))
    assert scenario.rig.sources == {"my_servo": str(folder / "my_servo.py")}


def test_a_file_is_found_in_the_working_folder_and_where_python_looks(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert load("paper", [f"controller={MINE}"]).rig.sources == {
        "my_servo": str(folder / "my_servo.py")
    }
    ours = load("paper", ["controller=module_agent.firmware.servo:Servo"]).rig.sources
    assert ours["module_agent.firmware.servo"].endswith("module_agent/firmware/servo.py")


def test_a_module_may_lie_in_a_package(folder: Path) -> None:
    package = folder / "laws"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "gains.py").write_text("GAIN = 5.0\n")
    text = f"from .gains import GAIN\n{SERVO.format(body='return GAIN')}"
    (package / "constant.py").write_text(text)
    torques = mine(folder, lines='controller = {hip = "laws.constant:Mine"}').torques_nm
    assert (torques[:, 2] == 5.0).all()


# --- What is wrong -------------------------------------------------------------------------------


def test_every_mistake_is_told_at_once_with_its_key(folder: Path) -> None:
    found = complaints(
        folder,
        "controller=nowhere:Mine",
        "board.0.controller=my_servo:Thine",
        "board.1.controller=my_election:Mine",
        "board.2.controller=nonsense",
        "election.rule=my_servo:Mine",
        "run.duration_s=-1",
    )
    assert [line.partition(": ")[0] for line in sorted(found)] == [
        "board.0.controller",
        "board.1.controller",
        "board.2.controller",
        "controller",
        "election.rule",
        "run.duration_s",
    ]
    told = "\n".join(found)
    assert f"there is no nowhere.py in {folder}" in told
    assert "my_servo.py has no class Thine" in told
    assert "my_election:Mine: has no method torque_nm(seen)" in told
    assert "'nonsense' names no class; write it like my_module:MyClass" in told
    assert "my_servo:Mine: has no method vote(now)" in told


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("class Mine: pass", "has no method torque_nm(seen)"),
        ("Mine = 3", "has no class Mine"),
        (WORKS.replace("(self, config)", "(self)"), "must be made with one argument"),
        (WORKS.replace("(self, config)", "(self, *, config)"), "must be made with one argument"),
        (WORKS.replace("(self, seen)", "(self)"), "torque_nm must take one argument, seen"),
        (WORKS.replace("(self, seen)", "(self, a, b)"), "torque_nm must take one argument, seen"),
        ("def torque_nm(:", "SyntaxError: invalid syntax (my_servo.py:1)"),
        ("import no_such_library", "ModuleNotFoundError: No module named 'no_such_library'"),
        ("x = 1 / 0", "ZeroDivisionError: division by zero (my_servo.py:1 in <module>: x = 1 / 0)"),
        ("raise SystemExit(7)", "SystemExit: 7"),
    ],
)
def test_a_class_that_does_not_fit_is_told_why(folder: Path, text: str, complaint: str) -> None:
    (folder / "my_servo.py").write_text(text, encoding="utf-8")
    (found,) = complaints(folder, f"board.0.controller={MINE}")
    assert found.startswith("board.0.controller: ")
    assert complaint in found


def test_what_fits_in_another_way_is_taken(folder: Path) -> None:
    """Defaults, `*args`, inheritance: whatever can be called."""
    text = "class Law:\n    def __init__(self, *things): pass\n"
    text += "    def torque_nm(self, seen, gain=2.0): return 0.0\nclass Mine(Law): pass\n"
    (folder / "my_servo.py").write_text(text, encoding="utf-8")
    scenario = load(str(folder / "mine.toml"), [f"controller={MINE}"])
    assert {str(board.controller and board.controller.reference) for board in scenario.boards} == {
        MINE
    }


def test_a_joint_that_the_body_has_not_is_a_mistake(folder: Path) -> None:
    assert complaints(folder, f"controller.elbow={MINE}") == [
        "controller.elbow: the body has no such joint; it has ankle, knee, hip"
    ]
    (wrong,) = complaints(folder, "controller=3")
    assert wrong.startswith("controller: must be a class, such as my_module:MyServo, or a table")


def test_what_a_file_prints_is_not_mixed_with_what_we_print(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A program reads our standard output."""
    (folder / "my_servo.py").write_text(f"print('loaded')\n{WORKS}", encoding="utf-8")
    load(str(folder / "mine.toml"), [f"controller={MINE}"])
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "loaded\n")


# --- Its hash ------------------------------------------------------------------------------------


def test_the_digest_covers_the_file_but_not_where_it_lies(folder: Path) -> None:
    """So processes started with different files refuse each other, on whatever machine."""
    settings = [f"controller={MINE}"]
    digest = load(str(folder / "mine.toml"), settings).digest
    assert digest == load(str(folder / "mine.toml"), settings).digest
    assert digest != load(str(folder / "mine.toml")).digest
    elsewhere = folder / "elsewhere"
    elsewhere.mkdir()
    for name in ("mine.toml", "my_servo.py"):
        (elsewhere / name).write_bytes((folder / name).read_bytes())
    assert digest == load(str(elsewhere / "mine.toml"), settings).digest
    (elsewhere / "my_servo.py").write_text(f"{WORKS}\n")
    assert digest != load(str(elsewhere / "mine.toml"), settings).digest


def test_a_twin_of_a_recorded_scenario_wants_the_file_that_was_meant(folder: Path) -> None:
    scenario = load(str(folder / "mine.toml"), [f"controller={MINE}"])
    ankle, *others = scenario.boards
    assert ankle.controller is not None
    other = replace(ankle, controller=replace(ankle.controller, sha256="0" * 64))
    with pytest.raises(ScenarioError, match=r"my_servo\.py: has changed since"):
        run_twin(replace(scenario, boards=(other, *others)))


# --- A run ---------------------------------------------------------------------------------------


def test_our_own_classes_from_outside_give_the_same_motion(folder: Path) -> None:
    ours = mine(folder)
    named = mine(
        folder,
        "controller=module_agent.firmware.servo:Servo",
        "election=module_agent.firmware.consensus:MaxConsensus",
    )
    assert named.state_sha256 == ours.state_sha256
    assert named.scenario != ours.scenario


def test_a_failure_is_an_event_of_its_tick_and_in_the_summary(folder: Path) -> None:
    text = SERVO.format(body="return 1.0 / (seen.tick - 123)")
    (folder / "my_servo.py").write_text(text, encoding="utf-8")
    run = mine(folder, lines=f'controller = {{knee = "{MINE}"}}')
    what = "ZeroDivisionError: float division by zero"
    where = "my_servo.py:7 in torque_nm: return 1.0 / (seen.tick - 123)"
    events = [(tick, event) for tick, event in run.events if isinstance(event, BoardFault)]
    assert events == [(123, BoardFault(1, FaultCode.CONTROLLER_RAISED, f"{what}\n{where}"))]
    told = summary(run, mode="twin")
    assert told["ending"] == "complete"
    assert told["faults"] == [{"joint": "knee", "tick": 123, "code": 1, "text": f"{what}\n{where}"}]
    assert not run.torques_nm[123:, 1].any(), "nobody drives the knee any more"
    assert run.torques_nm[123:, [0, 2]].any(axis=0).all(), "the others go on"
    assert run.state_sha256 == mine(folder, lines=f'controller = {{knee = "{MINE}"}}').state_sha256
