"""The boards together are the paper's control law.

Beside the boards, each of which knows one link and what its neighbours said, runs one controller
that knows the whole body at every tick and exchanges no messages. It is written from the paper's
equations alone: forward kinematics of all links, the lumped delay as a look back into the past,
an election as one argmax. Both drive a body of their own. Where the network brings everything
in time, they must be the same controller.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from deploy.launch.twin import Twin, run_twin
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from plant_server.body.body import Body
from plant_server.body.chain import Chain
from protocol.robot.scenario import Scenario
from protocol.wire.frames import Observation, decode, encode

pytestmark = pytest.mark.slow

Floats = NDArray[np.float64]


class Sample(NamedTuple):
    """All that can be said of the whole body at one instant, by forward kinematics."""

    alpha: Floats
    """Controlled variable of each module (BS, KNEE or TS in the paper)."""
    alpha_dot: Floats
    theta: Floats
    """Orientations of the links in space."""
    theta_dot: Floats
    alpha_com: Floats
    """Sway about each joint of the centre of mass of all that is above it."""


class CentralLaw:
    """The paper's equation for tau, restoring, with the integral that its text speaks of.

    tau_i = -[G_g alpha_CoM,i + G_servo (K_p eps_i + K_d d(alpha_i)/dt + K_i int eps_i)] at t - D
    """

    def __init__(self, scenario: Scenario) -> None:
        boards, election = scenario.boards, scenario.election
        links, servos = [board.link for board in boards], [board.servo for board in boards]
        self.controls = [board.controls.value for board in boards]
        self.mass = np.array([link.mass_kg for link in links])
        self.length = np.array([link.length_m for link in links])
        self.com = np.array([link.com_m for link in links])
        self.kp = np.array([servo.kp_nm_rad for servo in servos])
        self.kd = np.array([servo.kd_nm_s_rad for servo in servos])
        self.ki = np.array([servo.ki_nm_rad_s for servo in servos])
        self.g_servo = np.array([servo.g_servo for servo in servos])
        self.g_g = np.array([servo.gravity_weight for servo in servos]) * self.kp
        self.reference = np.array([board.reference_rad for board in boards])
        self.delay_ticks = [board.lumped_delay_ticks for board in boards]
        self.tick_s = scenario.run.tick_s
        self.election = election if election.enabled else None
        self.holds_orientation = election.disabled_holds == "link-orientation"
        self.past: list[Sample] = []
        self.y = np.ones(len(boards), dtype=bool)
        self.alpha_bar = np.zeros(len(boards))
        self.integral = np.zeros(len(boards))
        self.w_0 = np.zeros(len(boards))

    def look(self, q: Floats, q_dot: Floats) -> Sample:
        """Forward kinematics: from the foot up, over all links."""
        theta, theta_dot = np.cumsum(q), np.cumsum(q_dot)
        along = np.stack([np.sin(theta), np.cos(theta)])
        across = np.stack([np.cos(theta), -np.sin(theta)]) * theta_dot
        # Places and velocities of the joints (the lower ends of the links) and of the links' CoM.
        joint = np.cumsum(self.length * along, axis=1) - self.length * along
        joint_dot = np.cumsum(self.length * across, axis=1) - self.length * across
        com, com_dot = joint + self.com * along, joint_dot + self.com * across

        size = len(theta)
        sway, sway_dot = np.empty(size), np.empty(size)
        for i in range(size):
            weights = self.mass[i:] / self.mass[i:].sum()
            x, z = (com[:, i:] - joint[:, i : i + 1]) @ weights
            x_dot, z_dot = (com_dot[:, i:] - joint_dot[:, i : i + 1]) @ weights
            sway[i] = np.arctan2(x, z)
            sway_dot[i] = (x_dot * z - x * z_dot) / (x * x + z * z)
        choices = {
            "body-sway": (sway, sway_dot),
            "joint-angle": (q, q_dot),
            "link-orientation": (theta, theta_dot),
        }
        alpha = np.array([choices[name][0][i] for i, name in enumerate(self.controls)])
        alpha_dot = np.array([choices[name][1][i] for i, name in enumerate(self.controls)])
        return Sample(alpha, alpha_dot, theta, theta_dot, sway)

    def torques_nm(self, k: int, q: Floats, q_dot: Floats) -> Floats:
        """The torques of tick k = 0, 1, ..., given the state at its start."""
        self.past.append(self.look(q, q_dot))
        # Before the release the body stood still in its initial posture, so sample 0 is the past.
        old = [self.past[max(0, k - delay)] for delay in self.delay_ticks]
        seen = Sample(*(np.array([s[f][i] for i, s in enumerate(old)]) for f in range(5)))
        held = seen.theta if self.holds_orientation else seen.alpha
        self.elect(k, np.abs(seen.alpha - self.reference), held)
        error = np.where(self.y, seen.alpha - self.reference, held - self.alpha_bar)
        rate = seen.alpha_dot
        if self.holds_orientation:
            rate = np.where(self.y, rate, seen.theta_dot)
        self.integral = self.integral + error * self.tick_s
        servo = self.kp * error + self.kd * rate + self.ki * self.integral
        return np.asarray(-(self.g_g * seen.alpha_com + self.g_servo * servo))

    def elect(self, k: int, w: Floats, held: Floats) -> None:
        """Freeze w at k T_e; R rounds of agreement later, y_i = 1 for the argmax alone."""
        if self.election is None:
            return
        epoch_tick = k % self.election.period_ticks
        if epoch_tick == 0:
            self.w_0 = w
        if epoch_tick == self.election.rounds:
            y = np.arange(len(w)) == np.argmax(self.w_0)
            deactivated = self.y & ~y
            self.alpha_bar = np.where(deactivated, held, self.alpha_bar)
            self.y = y


class Run(NamedTuple):
    """What the central law did to a body of its own."""

    angles_rad: Floats
    torques_nm: Floats
    controlled_rad: Floats
    enabled: NDArray[np.bool_]


def run_centrally(scenario: Scenario) -> Run:
    law, boards = CentralLaw(scenario), scenario.boards
    orientations = np.array([board.initial_rad for board in boards])
    body = Body(
        Chain([board.link for board in boards]),
        initial_angles_rad=np.diff(orientations, prepend=0.0).tolist(),
        tick_s=scenario.run.tick_s,
        substeps=scenario.run.substeps,
    )
    angles, torques, controlled, enabled = [body.angles_rad], [], [], []
    for k in range(scenario.run.ticks):
        tau = law.torques_nm(k, np.array(body.angles_rad), np.array(body.rates_rad_s))
        body.step(tau.tolist())
        angles.append(body.angles_rad)
        torques.append(tau)
        old = [law.past[max(0, k - delay)].alpha for delay in law.delay_ticks]
        controlled.append([alpha[i] for i, alpha in enumerate(old)])
        enabled.append(law.y)
    return Run(np.array(angles), np.array(torques), np.array(controlled), np.array(enabled))


def assert_same_controller(scenario: Scenario) -> None:
    """Every signal agrees to 1e-12 of its largest magnitude over the run.

    The two controllers do the same arithmetic in another order, so each torque differs by some
    roundings of its largest terms: 1e-15 of it. The loop is stable and does not amplify what it is
    fed with, and over 2000 ticks 1e-12 is a thousand times that. One sample taken a tick too
    early or late, in one term of one board, shows as 1e-3.
    """
    boards, central = (
        trajectory(scenario, *run_twin(scenario)),
        run_centrally(scenario),
    )
    assert boards.ending == "complete"
    limits = [board.servo.torque_limit_nm for board in scenario.boards]
    assert (np.abs(central.torques_nm) < limits).all()  # Saturation is not the paper's.
    assert (boards.enabled == central.enabled).all()
    for ours, theirs in (
        (boards.angles_rad, central.angles_rad),
        (boards.torques_nm, central.torques_nm),
        (boards.controlled_rad, central.controlled_rad),
    ):
        largest = np.abs(theirs).max(axis=0)
        assert (np.abs(ours - theirs).max(axis=0) <= 1e-12 * largest).all()


@pytest.mark.parametrize(
    "overrides",
    [
        ["election.enabled=false"],
        ["election.enabled=true"],
        ["election.disabled_holds=link-orientation"],
        ["election.rounds=5", "board.1.reference_deg=3", "board.2.reference_deg=-2"],
        ["board.0.lumped_delay_ms=2", "board.1.lumped_delay_ms=7", "board.2.lumped_delay_ms=0"],
        ["board.0.imu=true", "board.1.imu=true", "board.0.lumped_delay_ms=4"],
    ],
    ids=["original", "distributed", "figure-4", "references", "own-delays", "more-imus"],
)
def test_three_boards_are_the_papers_controller(overrides: list[str]) -> None:
    """Two seconds of the paper's experiment, and of variations that tell its terms apart."""
    assert_same_controller(load("paper", ["run.duration_s=2", *overrides]))


FIVE_LINKS = """
description = "Five links, none like another, every kind of controlled variable."

[run]
duration_s = 2.0

[election]
enabled = {elections}
period_s = 0.05
rounds = 4
"""

FIVE_BOARDS = [
    # joint, controls, delay in ms, initial and reference in degrees; mass, length, com; K_p, K_d
    ("ankle", "body-sway", 4, -3.0, 1.0, 8.0, 0.45, 0.26, 500.0, 125.0),
    ("knee", "joint-angle", 3, -5.0, -4.0, 12.0, 0.40, 0.21, 330.0, 30.0),
    ("hip", "body-sway", 9, 6.0, 0.0, 16.0, 0.30, 0.17, 190.0, 30.0),
    ("waist", "joint-angle", 5, 9.0, 2.0, 14.0, 0.30, 0.12, 90.0, 8.0),
    ("neck", "link-orientation", 1, -8.0, -2.0, 5.0, 0.25, 0.11, 8.0, 1.5),
]


def five_links(folder: Path, *, elections: bool) -> Scenario:
    """A chain of five, its ankle four hops from the only IMU, with a delay of just four ticks."""
    text = FIVE_LINKS.format(elections=str(elections).lower())
    for joint, controls, delay, initial, reference, mass, length, com, kp, kd in FIVE_BOARDS:
        text += f"""
[[board]]
joint = "{joint}"
controls = "{controls}"
lumped_delay_ms = {delay}.0
initial_deg = {initial}
reference_deg = {reference}
imu = {str(joint == "neck").lower()}
servo = {{ kp_nm_rad = {kp}, kd_nm_s_rad = {kd}, ki_per_s = 0.3, gravity_weight = 0.7 }}
link = {{ name = "l_{joint}", mass_kg = {mass}, length_m = {length}, com_m = {com} }}
"""
    path = folder / "five_links.toml"
    path.write_text(text, encoding="utf-8")
    return load(str(path))


@pytest.mark.parametrize("elections", [False, True])
def test_five_boards_are_the_same_law(tmp_path: Path, *, elections: bool) -> None:
    """Nothing in the boards knows of three links; every delay is exactly met by its hops."""
    assert_same_controller(five_links(tmp_path, elections=elections))


def test_the_elections_are_elections(tmp_path: Path) -> None:
    """What the comparisons above go through: boards win, lose and win again.

    The paper's ankle never has the largest error in these two seconds; five links move more.
    """
    for scenario, winners_min in (
        (load("paper", ["run.duration_s=2"]), 2),
        (five_links(tmp_path, elections=True), 4),
    ):
        enabled = run_centrally(scenario).enabled
        first_latch = scenario.election.rounds
        winners = enabled[first_latch:].argmax(axis=1)
        assert len(set(winners.tolist())) >= winners_min
        assert np.count_nonzero(np.diff(winners)) >= 4


def test_a_board_knows_its_own_link_only(tmp_path: Path) -> None:
    """Locality, as wired: neighbours are the mechanical ones, and one link is told to one board."""
    scenario = five_links(tmp_path, elections=True)
    boards = [board for board in Twin(scenario).boards if board is not None]
    wires = [board.config.neighbours for board in boards]
    assert wires == [(1,), (0, 2), (1, 3), (2, 4), (3,)]
    for board, own in zip(boards, scenario.boards, strict=True):
        assert board.config.link == own.link
        assert len(board.hearings) == len(board.config.neighbours)


def said(scenario: Scenario, shaken: int | None) -> Iterator[list[tuple[bytes, ...]]]:
    """Per warm-up tick all frames of each board, where in tick -5 one board's sensors are shaken.

    The body is held, so that news of it can travel by link frames only.
    """
    twin = Twin(scenario)
    lockstep = twin.lockstep
    boards = [board for board in twin.boards if board is not None]
    while (tick := lockstep.plant.tick) < 0:
        said_now = []
        for board, (index, payload) in zip(boards, lockstep.open(), strict=True):
            observation = decode(Observation, payload)
            assert index == board.config.index
            if tick == -5 and index == shaken:
                true = observation.readings
                shaken_now = true._replace(
                    joint_rad=true.joint_rad + 1e-6, imu_rad=true.imu_rad + 2e-6
                )
                observation = observation._replace(readings=shaken_now)
            said_now.append(twin.answer(board, board.read(encode(observation))).links)
        for sender, links in enumerate(said_now):
            for receiver, link in zip(boards[sender].config.neighbours, links, strict=True):
                # Only to a neighbour, and on the wire that joins the two.
                twin.deliver(sender, receiver, link)
        lockstep.close()
        yield said_now


@pytest.mark.parametrize(
    ("shaken", "first_said"),
    [
        (4, {4: -5, 3: -4, 2: -3, 1: -2}),  # Down, from the IMU. The ankle tells nobody of it.
        (0, {0: -5, 1: -4, 2: -3, 3: -2}),  # Up, from the foot. The neck tells nobody of it.
        (2, {2: -3, 1: -2, 3: -2}),  # Both ways, when its sample has met that of foot and IMU.
    ],
)
def test_news_travels_one_link_a_tick(
    tmp_path: Path, shaken: int, first_said: dict[int, int]
) -> None:
    """Locality, as it works: what a board senses in tick k, the n-th from it can say in k + n.

    Not sooner, however fast the network is (S4); and not later, or a delay of as many ticks as
    hops would not be met. A sample is told on once it is complete, which the hip's is when
    the neck's and the foot's of the same tick have come to it over two links each.
    """
    scenario = five_links(tmp_path, elections=True)
    found: dict[int, int] = {}
    pairs = zip(said(scenario, None), said(scenario, shaken), strict=True)
    for tick, (calm, news) in enumerate(pairs, start=-9):
        for board in range(5):
            if calm[board] != news[board]:
                found.setdefault(board, tick)
    assert found == first_said
