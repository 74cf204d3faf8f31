from dataclasses import replace
from math import degrees, exp, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from deploy.launch.twin import run_twin
from deploy.outcome.indices import (
    Energy,
    Indices,
    Variable,
    all_indices,
    com_m,
    controlled_variables,
    elections,
    energy,
    indices,
    joint_positions_m,
    samples,
)
from deploy.recording.trajectory import Floats, Trajectory, trajectory
from deploy.scenario_file.load import load
from protocol.robot.hardware import Link
from protocol.robot.scenario import Controls

PENDULUM = """
[election]
rounds = 1
[[board]]
joint = "base"
controls = "{controls}"
initial_deg = 5.0
lumped_delay_ms = 0.0
imu = true
[board.servo]
kp_nm_rad = 300.0
kd_nm_s_rad = 60.0
[board.link]
name = "{link}"
mass_kg = 10.0
length_m = 1.0
com_m = 0.5
"""


def run(source: str = "paper", *overrides: str) -> Trajectory:
    scenario = load(source, list(overrides))
    return trajectory(scenario, *run_twin(scenario))


@pytest.fixture(scope="module")
def second() -> Trajectory:
    return run("paper", "run.duration_s=1")


def judged(times_s: Floats, values_rad: Floats, reference_rad: float = 0.0) -> Indices:
    return indices(times_s, Variable("TS", reference_rad, values_rad))


def damped_cosine(damping: float, rate_rad_s: float, duration_s: float) -> tuple[Floats, Floats]:
    """A second-order step response from 1 rad to 0, released at rest."""
    times_s = np.arange(round(duration_s * 100)) / 100
    omega = rate_rad_s * sqrt(1 - damping**2)
    phase = omega * times_s
    sine = damping / sqrt(1 - damping**2) * np.sin(phase)
    return times_s, np.exp(-damping * rate_rad_s * times_s) * (np.cos(phase) + sine)


def test_overshoot_of_a_damped_cosine_is_the_textbooks() -> None:
    damping = 0.3
    found = judged(*damped_cosine(damping, 2.0, 20.0))
    expected = degrees(exp(-pi * damping / sqrt(1 - damping**2)))
    # The peak lies up to 5 ms beside a sample, where (rate x 5 ms)^2 / 2 of it is lost.
    assert found.overshoot_deg == pytest.approx(expected, rel=1e-4)


def test_rise_is_the_first_sample_at_or_past_the_reference() -> None:
    times_s, values = damped_cosine(0.3, 2.0, 20.0)
    found = judged(times_s, values)
    assert found.rise_s is not None
    assert found.rise_90_s is not None
    at, at_90 = round(found.rise_s * 100), round(found.rise_90_s * 100)
    assert values[at] <= 0.0 < values[at - 1]
    assert values[at_90] <= 0.1 < values[at_90 - 1]


def test_settling_in_the_band_is_the_last_sample_outside_two_percent() -> None:
    times_s = np.arange(1000) / 100
    found = judged(times_s, np.exp(-times_s))
    assert found.settling_band_s == 3.91  # ln 50 = 3.912
    assert found.rise_s is None
    assert found.overshoot_deg == 0.0


def test_the_papers_settling_is_the_sample_after_the_last_outside_of_the_last_value() -> None:
    """The author's own code: `t(min(L, last + 1))` of samples 0:0.01:9.99."""
    times_s = np.arange(1000) / 100
    assert judged(times_s, 1.0 + np.exp(-times_s)).settling_paper_s == 3.91  # 3.90 is outside
    step = np.where(times_s < 5.0, 1.5, 1.0)
    assert judged(times_s, step).settling_paper_s == 5.0
    assert judged(times_s, np.ones(1000)).settling_paper_s == 0.0


def test_the_papers_settling_of_what_ends_at_zero_is_the_last_sample_whatever_the_motion() -> None:
    times_s = np.arange(1000) / 100
    for rate in (0.5, 3.0, 30.0):
        approach = np.exp(-rate * times_s)
        assert judged(times_s, approach - approach[-1]).settling_paper_s == 9.99
    assert judged(times_s, np.exp(-3.0 * times_s)).settling_paper_s == 9.99


def test_what_ends_outside_the_band_has_not_settled() -> None:
    times_s = np.arange(100) / 100
    assert judged(times_s, 1.0 - 0.5 * times_s).settling_band_s is None


@pytest.mark.parametrize("reference_rad", [0.0, 0.2])
def test_a_start_at_the_reference_has_no_side_to_overshoot(reference_rad: float) -> None:
    times_s = np.arange(100) / 100
    found = judged(times_s, reference_rad + 0.1 * np.sin(times_s), reference_rad)
    assert (found.overshoot_deg, found.rise_s, found.rise_90_s) == (None, 0.0, 0.0)


def test_standing_still_at_the_reference_is_settled() -> None:
    found = judged(np.arange(100) / 100, np.zeros(100))
    assert found == Indices(None, 0.0, 0.0, 0.0, 0.0)


def test_indices_do_not_change_with_the_mirror_image(second: Trajectory) -> None:
    mirrored = replace(
        second,
        angles_rad=-second.angles_rad,
        rates_rad_s=-second.rates_rad_s,
        torques_nm=-second.torques_nm,
    )
    assert all_indices(mirrored) == all_indices(second)
    assert energy(mirrored) == energy(second)


@pytest.mark.parametrize("offset_rad", [-0.5, 0.25])
def test_indices_but_the_papers_settling_do_not_change_with_the_reference(
    offset_rad: float,
) -> None:
    times_s, values = damped_cosine(0.2, 3.0, 10.0)
    here, there = judged(times_s, values), judged(times_s, values + offset_rad, offset_rad)
    assert there.overshoot_deg == pytest.approx(here.overshoot_deg)
    assert there[1:3] == here[1:3]
    assert there.settling_band_s == here.settling_band_s


def test_s21_samples_are_every_tenth_state_without_the_last(second: Trajectory) -> None:
    found = samples(second)
    assert found.states.tolist() == list(range(0, 1000, 10))
    assert found.times_s[-1] == 0.99


@pytest.mark.parametrize("tick_ms", [0.5, 4.0, 20.0])
def test_s21_samples_stay_at_100_hz_whatever_the_tick(tick_ms: float) -> None:
    found = samples(run("paper", *with_tick(tick_ms)))
    assert len(found.times_s) == 20
    assert np.abs(found.states * tick_ms / 1e3 - found.times_s).max() <= tick_ms / 2e3 + 1e-12


def with_tick(tick_ms: float) -> list[str]:
    delays = [f"board.{i}.lumped_delay_ms={max(2 * tick_ms, 4.0)}" for i in range(3)]
    return ["run.duration_s=0.2", f"run.tick_ms={tick_ms}", "election.period_s=0.2", *delays]


def test_variables_are_what_the_boards_themselves_control(second: Trajectory) -> None:
    """The servo's own variable is the same, one lumped delay of 10 ticks later."""
    found = controlled_variables(second)
    assert [variable.name for variable in found] == ["TS", "KNEE", "BS"]
    for variable, board in zip(found, (2, 1, 0), strict=True):
        boards_own_rad = second.controlled_rad[10::10, board]
        np.testing.assert_allclose(variable.values_rad[:-1], boards_own_rad, atol=1e-14)


def test_an_upright_body_has_its_centre_of_mass_where_the_masses_say() -> None:
    boards = load("paper").boards
    upright = np.zeros((1, 3))
    # (10 x 0.25 + 10 x 0.75 + 30 x 1.25) / 50
    assert com_m(boards, upright).tolist() == [[0.0, 0.95]]
    assert joint_positions_m(boards, upright)[0, :, 1].tolist() == [0.0, 0.5, 1.0, 1.5]
    np.testing.assert_allclose(com_m(boards, upright + pi / 2), [[0.95, 0.0]], atol=1e-15)


@pytest.mark.parametrize(
    ("controls", "link", "name"),
    [
        ("body-sway", "body", "BS"),
        ("joint-angle", "body", "BASE"),
        ("link-orientation", "body", "BASE_LINK"),
        ("link-orientation", "trunk", "TS"),
    ],
)
def test_a_chain_of_one_link_has_one_variable(
    tmp_path: Path, controls: str, link: str, name: str
) -> None:
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM.format(controls=controls, link=link), encoding="utf-8")
    found = run(str(path), "run.duration_s=0.3")
    assert list(all_indices(found)) == [name]
    agreed = elections(found)
    assert agreed is not None
    assert agreed.rounds_to_agreement == {"0": 3, "never": 0}


def test_equal_names_stay_apart(second: Trajectory) -> None:
    same = tuple(
        structs.replace(board, controls=Controls.LINK_ORIENTATION)
        for board in second.scenario.boards
    )
    scenario = structs.replace(second.scenario, boards=same, link_names=("trunk",) * 3)
    found = controlled_variables(replace(second, scenario=scenario))
    assert [variable.name for variable in found] == [
        "TS",
        "knee/link-orientation",
        "ankle/link-orientation",
    ]


def test_energy_of_a_known_motion(second: Trajectory) -> None:
    """2 Nm over +0.3 rad and back over -0.1 rad, on one joint."""
    way_rad = np.concatenate([np.linspace(0.0, 0.3, 501), np.linspace(0.3, 0.2, 501)[1:]])
    angles_rad = np.zeros((1001, 3))
    angles_rad[:, 1] = way_rad
    torques_nm = np.full((1000, 3), 2.0)
    found = energy(replace(second, angles_rad=angles_rad, torques_nm=torques_nm))
    assert found == pytest.approx(Energy(positive=0.6, absolute=0.8, net=0.4))


def test_net_energy_is_what_the_body_gained(second: Trajectory) -> None:
    """What the joints gave is in the body: potential and kinetic, friction there is none."""
    upright, bow = second.orientations_rad[-1:], second.orientations_rad[:1]
    boards = second.scenario.boards
    height_m = com_m(boards, upright)[0, 1] - com_m(boards, bow)[0, 1]
    gained_j = 50.0 * 9.81 * height_m + kinetic_j(second)
    # The step of the integrator, held torques included, conserves energy to its fourth order.
    assert energy(second).net == pytest.approx(gained_j, rel=1e-4)


def kinetic_j(trajectory_: Trajectory) -> float:
    """Kinetic energy at the end, by finite difference of each link's centre of mass."""
    boards, step_s = trajectory_.scenario.boards, 1e-6
    now = trajectory_.orientations_rad[-1:]
    rates = np.cumsum(trajectory_.rates_rad_s[-1:], axis=1)
    energy_j = 0.0
    for i, board in enumerate(boards):
        link = board.link

        def centre(angles: Floats, link: Link = link, i: int = i) -> Floats:
            direction = np.array([np.sin(angles[0, i]), np.cos(angles[0, i])])
            lower: Floats = joint_positions_m(boards, angles)[0, i] + link.com_m * direction
            return lower

        speed = (centre(now + step_s * rates) - centre(now)) / step_s
        energy_j += 0.5 * link.mass_kg * float(speed @ speed)
        energy_j += 0.5 * link.inertia_kg_m2 * float(rates[0, i]) ** 2
    return energy_j


def test_a_last_state_that_is_no_number_does_not_count(second: Trajectory) -> None:
    angles_rad = second.angles_rad.copy()
    angles_rad[-1] = [np.inf, -np.inf, np.nan]
    broken = replace(second, angles_rad=angles_rad)
    assert all_indices(broken) == all_indices(second)
    lost_j = energy(second).net - energy(broken).net
    last_j = float((second.torques_nm[-1] * np.diff(second.angles_rad[-2:], axis=0)[0]).sum())
    assert lost_j == pytest.approx(last_j, abs=1e-12)


def test_a_fallen_body_is_judged_up_to_its_fall() -> None:
    gains = ("kp_nm_rad", "kd_nm_s_rad", "gravity_weight")
    limp = [f"board.{i}.servo.{gain}=0" for i in range(3) for gain in gains]
    fallen = run("paper", "run.duration_s=1", *limp)
    assert fallen.ending == "fell"
    assert all_indices(fallen)["TS"].settling_band_s is None
    assert energy(fallen) == Energy(0.0, 0.0, 0.0)


@pytest.mark.parametrize(("ticks", "epochs"), [(2, 0), (3, 1), (102, 1), (103, 2), (1000, 10)])
def test_an_epoch_counts_once_its_last_round_was_played(
    second: Trajectory, ticks: int, epochs: int
) -> None:
    found = elections(cut(second, ticks))
    assert found is not None
    assert found.epochs == epochs
    assert sum(found.rounds_to_agreement.values()) == epochs
    assert found.enabled_0 + found.enabled_1 + found.enabled_2_or_more == epochs


def cut(whole: Trajectory, ticks: int) -> Trajectory:
    return replace(
        whole,
        angles_rad=whole.angles_rad[: ticks + 1],
        rates_rad_s=whole.rates_rad_s[: ticks + 1],
        torques_nm=whole.torques_nm[:ticks],
        asked_nm=whole.asked_nm[:ticks],
        controlled_rad=whole.controlled_rad[:ticks],
        enabled=whole.enabled[:ticks],
        epoch=whole.epoch[:ticks],
        round=whole.round[:ticks],
        urgency=whole.urgency[:ticks],
        candidate=whole.candidate[:ticks],
    )


def test_eq_achieved_max_cons_in_a_healthy_network(second: Trajectory) -> None:
    """Maximum in the middle: one round; at an end of the line of three: two. Never more."""
    found = elections(second)
    assert found is not None
    assert set(found.rounds_to_agreement) <= {"1", "2", "never"}
    assert found.rounds_to_agreement["never"] == 0
    assert found.enabled_1 == found.epochs == 10


def test_rounds_and_enabled_boards_of_hand_made_epochs(second: Trajectory) -> None:
    """Four epochs of four ticks: agreed at once, after one round, after two, never."""
    played = [
        ([[3, 3, 3]] * 3, [[2, 2, 2]] * 3, [0, 0, 1]),
        ([[1, 5, 2], [5, 5, 5], [5, 5, 5]], [[0, 1, 2], [1, 1, 1], [1, 1, 1]], [0, 1, 0]),
        ([[9, 5, 2], [9, 9, 5], [9, 9, 9]], [[0, 1, 2], [0, 0, 1], [0, 0, 0]], [0, 0, 0]),
        ([[9, 5, 2], [9, 9, 5], [9, 9, 5]], [[0, 1, 2], [0, 0, 1], [0, 0, 1]], [1, 1, 1]),
    ]
    election = structs.replace(second.scenario.election, enabled=True, period_ticks=4, rounds=2)
    scenario = structs.replace(second.scenario, election=election)
    found = elections(
        replace(
            cut(second, 16),
            scenario=scenario,
            epoch=np.repeat(np.arange(4), 4)[:, None] * np.ones((1, 3), dtype=np.int64),
            round=np.tile([0, 1, 2, 2], 4)[:, None] * np.ones((1, 3), dtype=np.int64),
            urgency=np.array([row for u, _, _ in played for row in (*u, u[-1])], dtype=float),
            candidate=np.array([row for _, c, _ in played for row in (*c, c[-1])]),
            enabled=np.array([y for _, _, y in played for _ in range(4)]),
        )
    )
    assert found is not None
    # In the first epoch all know the maximum from the start; they were told by nobody.
    assert found.rounds_to_agreement == {"0": 1, "1": 1, "2": 1, "never": 1}
    assert (found.epochs, found.enabled_0, found.enabled_1, found.enabled_2_or_more) == (4, 1, 2, 1)


def test_a_board_that_is_not_in_an_epoch_has_no_say_in_it(second: Trajectory) -> None:
    absent = second.epoch.copy()
    absent[:, 2] = -1
    found = elections(replace(cut(second, 100), epoch=absent[:100]))
    assert found is not None
    # The others talk of the absent board's urgency, which none of them began with.
    assert found.rounds_to_agreement == {"never": 1}
    assert found.enabled_0 == 1


def test_nobody_is_elected_without_elections() -> None:
    assert elections(run("paper", "run.duration_s=0.1", "election.enabled=false")) is None
