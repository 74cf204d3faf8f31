"""A scenario file is checked whole: every mistake at once, each with its file and its key."""

import json
from math import radians
from pathlib import Path
from typing import Any

import pytest

from deploy.scenario_file.load import SCENARIOS, available, load
from protocol.robot.scenario import ScenarioError, canonical, decode

PAPER = (SCENARIOS / "paper.toml").read_text(encoding="utf-8")


def robot(links: int, head: str = "", **changes: str) -> str:
    """A chain of links in TOML; `changes` are lines of the lowest board."""
    boards = []
    for i in range(links):
        values = {"joint": f'"j{i}"', "controls": '"joint-angle"', "lumped_delay_ms": "5"}
        values |= {"imu": "true"} if i == links - 1 else {}
        values |= changes if i == 0 else {}
        lines = "\n".join(f"{key} = {value}" for key, value in values.items())
        boards.append(
            f"[[board]]\n{lines}\n[board.servo]\nkp_nm_rad = 60\nkd_nm_s_rad = 1\n"
            f'[board.link]\nname = "link{i}"\nmass_kg = 4\nlength_m = 0.3\ncom_m = 0.1\n'
        )
    return head + "\n".join(boards)


def written(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def complaints(source: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load(source, list(overrides))
    return str(caught.value).splitlines()


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ("run.duration_s=-1", "run.duration_s: input should be greater than 0"),
        ("run.duration_s=1e300", "run.duration_s: input should be less than or equal to 100000"),
        ("run.duration_s=nan", "run.duration_s: input should be "),
        ("run.duration_s='2'", "run.duration_s: input should be a valid number"),
        ("run.duration_s=2.0005", "run.duration_s: 2.0005 s is not a whole number of ticks of 1"),
        ("run.duration_ms=2000", "run.duration_ms: unknown key; did you mean 'duration_s'?"),
        ("run.substeps=1.5", "run.substeps: input should be a valid integer"),
        ("run.seed=-1", "run.seed: input should be greater than or equal to 0"),
        ("elections.rounds=2", "elections: unknown key; did you mean 'election'?"),
        ("election.enabled=yes", "election.enabled: input should be a valid boolean"),
        ("election.period_s=0.1005", "election.period_s: 0.1005 s is not a whole number of ticks"),
        ("election.period_s=0.002", "election.rounds: 2 rounds, one a tick, do not fit into a "),
        ("election.rounds=100", "election.rounds: 100 rounds, one a tick, do not fit into a "),
        ("election.rounds=0", "election.rounds: input should be greater than or equal to 1"),
        ("election.rounds=1", "election.rounds: 1 is less than the 2 hops from end to end"),
        ("election.disabled_holds=hope", "election.disabled_holds: input should be 'controlled"),
        ("rig.name=Robot 1", "rig.name: 'Robot 1' is no name; it takes lower case"),
        ("rig.base_port=80", "rig.base_port: input should be greater than or equal to 1024"),
        ("board.1.joint=ankle", "board.1.joint: 'ankle' is already board.0"),
        ("board.1.joint=plant", "board.1.joint: 'plant' is reserved; choose another name"),
        ("board.1.joint=Left Knee", "board.1.joint: 'Left Knee' is no name"),
        ("board.1.controls=sway", "board.1.controls: input should be 'body-sway', 'joint-angle'"),
        ("board.0.lumped_delay_ms=1.5", "board.0.lumped_delay_ms: 1.5 ms is not a whole number"),
        ("board.0.lumped_delay_ms=1", "board.0.lumped_delay_ms: 1 ticks are fewer than the 2 hops"),
        ("board.2.imu=false", "board.2.imu: the top board must carry an IMU"),
        ("board.0.servo.kp=3", "board.0.servo.kp: unknown key; there are: kp_nm_rad, kd_nm_s_rad"),
        ("board.0.servo.kp_nm_rads=3", "board.0.servo.kp_nm_rads: unknown key; did you mean 'kp"),
        ("board.0.servo.kp_nm_rad=-3", "board.0.servo.kp_nm_rad: input should be greater than or "),
        ("board.0.link.mass_kg=-10", "board.0.link.mass_kg: input should be greater than 0"),
        ("board.0.link.mass_g=10000", "board.0.link.mass_g: unknown key; did you mean 'mass_kg'?"),
        ("board.0.link.com_m=0.6", "board.0.link: com_m 0.6 lies beyond length_m 0.5"),
        ("board.0.initial_deg=120", "board.0.initial_deg: with these initial angles the centre"),
        ("board=3", "board: input should be a valid list"),
        ("board=[]", "board: list should have at least 1 item"),
        ("run=3", "run: input should be a valid dictionary or instance of Run"),
    ],
)
def test_a_mistake_is_named_with_its_file_and_key(setting: str, complaint: str) -> None:
    found = complaints("paper", setting)
    prefix = f"{SCENARIOS / 'paper.toml'}: {complaint}"
    assert any(line.startswith(prefix) for line in found), found


@pytest.mark.parametrize("key", ["joint", "controls", "servo", "link"])
def test_what_must_be_said_is_asked_for(key: str, tmp_path: Path) -> None:
    text = PAPER.replace("[board.servo]", "[board.servos]") if key == "servo" else PAPER
    text = text.replace("[board.link]", "[board.links]") if key == "link" else text
    lines = [line for line in text.splitlines() if not line.startswith(f"{key} =")]
    path = written(tmp_path, "\n".join(lines))
    assert {f"{path}: board.{i}.{key}: field required" for i in range(3)} <= set(complaints(path))


def test_all_mistakes_come_at_once(tmp_path: Path) -> None:
    """Of single values, between values, and of settings; whatever kinds there are beside it."""
    head = "[run]\nduration_ms = 3\n[elektion]\n[election]\nperiod_s = 0.0015\nrounds = 4\n"
    path = written(tmp_path, robot(5, head, joint='"j3"', lumped_delay_ms="2", imus="true"))
    found = complaints(
        path, "nonsense", "board.9.imu=true", "board.2.link.mass_kg=-1", "board.4.imu=false"
    )
    assert found[:2] == [
        "--set nonsense: expected key=value, such as run.duration_s=2",
        "--set board.9.imu=true: there is no 'board.9.imu' to set",
    ]
    assert all(line.startswith(f"{path}: ") for line in found[2:])
    assert sorted(line.split(": ")[1] for line in found[2:]) == [
        "board.0.imus",
        "board.0.lumped_delay_ms",
        "board.2.link.mass_kg",
        "board.3.joint",
        "board.4.imu",
        "election.period_s",
        "elektion",
        "run.duration_ms",
    ]


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("papr", "papr: no such scenario; did you mean 'paper'?"),
        ("zzz", "zzz: no such scenario; there are: "),
        ("elsewhere/mine.toml", "elsewhere/mine.toml: no such file"),
    ],
)
def test_a_scenario_that_is_not_there_gets_a_suggestion(source: str, complaint: str) -> None:
    (found,) = complaints(source)
    assert found.startswith(complaint)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"[run\n", "not TOML: "),
        (b"[run]\nseed = 1\nseed = 2\n", "not TOML: "),
        (b"description = '\xff'\n", "cannot be read: "),
    ],
)
def test_a_file_that_is_no_toml_is_one_line(content: bytes, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    (found,) = complaints(str(path))
    assert found.startswith(f"{path}: {complaint}")


def test_s3_a_robot_needs_ports_for_all_of_its_boards(tmp_path: Path) -> None:
    path = written(tmp_path, robot(600, "[election]\nenabled = false\n", lumped_delay_ms="600"))
    found = complaints(path, "rig.base_port=65000")
    assert (
        f"{path}: rig.base_port: 65000 and one more for each of 600 boards goes beyond" in found[0]
    )
    assert "base_port" not in complaints(path, "rig.base_port=64935")[0]


@pytest.mark.parametrize(
    ("setting", "path", "value"),
    [
        ("run.seed=7", ("run", "seed"), 7),
        (" run.seed = 0x10 ", ("run", "seed"), 16),
        ("run.duration_s=2", ("run", "ticks"), 2000),
        ("rig.name=left", ("rig", "name"), "left"),
        ("rig.name='left'", ("rig", "name"), "left"),
        ("description=two = one + one", ("description",), "two = one + one"),
        ("election.enabled=false", ("election", "enabled"), False),
        ("board.1.servo.kp_nm_rad=100", ("board", 1, "servo", "kp_nm_rad"), 100.0),
        ("board.2.link.inertia_kg_m2=2.5", ("board", 2, "link", "inertia_kg_m2"), 2.5),
    ],
)
def test_one_value_is_changed_by_its_path(
    setting: str, path: tuple[str | int, ...], value: object
) -> None:
    place: Any = json.loads(canonical(load("paper", [setting])))
    for key in path:
        place = place[key]
    assert place == value


@pytest.mark.parametrize(
    "setting", ["board.3.imu=true", "board.x.imu=true", "run.seed.low=1", "description.long=x"]
)
def test_a_path_that_leads_nowhere_is_one_line(setting: str) -> None:
    path = setting.partition("=")[0]
    assert complaints("paper", setting) == [f"--set {setting}: there is no {path!r} to set"]


def test_later_settings_win() -> None:
    assert load("paper", ["run.seed=2", "run.seed=3"]).run.seed == 3


def test_resolved_values_are_in_si_and_whole_ticks() -> None:
    scenario = load("paper", ["run.tick_ms=0.5", "board.1.reference_deg=5"])
    run, election, knee = scenario.run, scenario.election, scenario.boards[1]
    assert (run.ticks, run.tick_s) == (20_000, 0.0005)
    assert (election.period_ticks, election.rounds) == (200, 2)
    assert knee.lumped_delay_ticks == 20
    assert knee.initial_rad == radians(-8.0)
    assert knee.reference_rad == radians(5.0)
    # What a user gives per unit of K_p, the servo takes in torque.
    assert knee.servo.ki_nm_rad_s == 0.2 * 220.72
    assert scenario.link_names == ("shank", "thigh", "trunk")


def test_a_link_is_a_slender_rod_unless_it_says_otherwise() -> None:
    """m l^2 / 12, also with its centre of mass elsewhere than in the middle."""
    links = [board.link for board in load("paper", ["board.0.link.com_m=0.1"]).boards]
    expected = [10 * 0.25 / 12, 10 * 0.25 / 12, 30 * 0.25 / 12]
    assert [link.inertia_kg_m2 for link in links] == expected
    given = load("paper", ["board.0.link.inertia_kg_m2=0.5"]).boards[0].link
    assert given.inertia_kg_m2 == 0.5


def test_the_papers_table_1_is_kept_as_printed() -> None:
    boards = load("paper").boards
    assert [board.joint for board in boards] == ["ankle", "knee", "hip"]
    servos, links = [board.servo for board in boards], [board.link for board in boards]
    assert [servo.kp_nm_rad for servo in servos] == [465.98, 220.72, 73.57]
    assert [servo.kd_nm_s_rad for servo in servos] == [116.49, 16.55, 18.394]
    assert [servo.g_servo for servo in servos] == [1.0, 1.0, 1.0]
    assert [link.mass_kg for link in links] == [10.0, 10.0, 30.0]
    assert [(link.length_m, link.com_m) for link in links] == [(0.5, 0.25)] * 3
    assert [board.lumped_delay_ticks for board in boards] == [10, 10, 10]


def test_s23_the_digest_is_of_what_the_scenario_means(tmp_path: Path) -> None:
    """Where it came from, how it was written, and where the robot lives say nothing of it."""
    digest = load("paper").digest
    copied = tmp_path / "paper.toml"
    copied.write_text("# mine\n" + PAPER.replace("= 10.0", "= 10.00"), encoding="utf-8")
    assert load(str(copied)).digest == digest
    assert load("paper", ["rig.base_port=20000", "rig.name=other"]).digest == digest
    assert load("paper", ["run.seed=1", "run.duration_s=10"]).digest == digest
    for setting in ("run.seed=2", "run.duration_s=9.999", "board.2.servo.kp_nm_rad=73.58"):
        assert load("paper", [setting]).digest != digest


@pytest.mark.parametrize("links", [1, 5])
def test_a_body_may_have_any_number_of_links(links: int, tmp_path: Path) -> None:
    found = load(written(tmp_path, robot(links, f"[election]\nrounds = {max(links - 1, 1)}\n")))
    assert found.joints == [f"j{i}" for i in range(links)]
    assert found.name == "mine"
    assert [board.imu for board in found.boards] == [False] * (links - 1) + [True]


@pytest.mark.parametrize("name", available())
def test_every_scenario_that_comes_along_is_fine_and_says_what_it_shows(name: str) -> None:
    found = load(name)
    assert len(found.description) > 20
    assert decode(canonical(found)) == found
