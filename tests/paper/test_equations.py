"""One test per claim of the paper, named after the label of its equation.

In the twin a board's y, round and urgency are what its torque frames say, tick by tick. The
epoch k of the paper begins at tick k T_e; its w are frozen there, its two iterations are the two
ticks that follow, and its y is latched in the second of them.
"""

from functools import cache
from itertools import combinations, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from deploy.launch.twin import run_twin
from deploy.recording.trajectory import Trajectory, trajectory
from deploy.scenario_file.load import load
from module_agent.firmware.controller import Candidate
from module_agent.firmware.election import Gossip
from protocol.wire.frames import TorqueFrame, decode
from tests.module_agent.player import Player

Floats = NDArray[np.float64]
Graph = tuple[tuple[int, ...], ...]
"""Per node, the nodes that it hears: the paper's N_i."""

LINE: Graph = ((1,), (0, 2), (1,))
ROUNDS, PERIOD_TICKS, DELAY_TICKS = 2, 100, 10
EPOCHS = 20


@cache
def run(*overrides: str) -> Trajectory:
    scenario = load("paper", ["run.duration_s=2", *overrides])
    return trajectory(scenario, *run_twin(scenario))


def latch_ticks() -> range:
    """Ticks in which epochs 0 to 19 latch their y."""
    return range(ROUNDS, EPOCHS * PERIOD_TICKS, PERIOD_TICKS)


def errors_rad(moved: Trajectory) -> Floats:
    """w of each module at each tick, from the whole body: |BS|, |KNEE|, |TS| (reference upright).

    Uniform links, so each centre of mass is half way up.
    """
    theta = moved.orientations_rad
    mass, length = np.array([10.0, 10.0, 30.0]), 0.5
    above = np.array([mass[i] / 2.0 + mass[i + 1 :].sum() for i in range(3)])
    sway = np.arctan2(np.sin(theta) @ (above * length), np.cos(theta) @ (above * length))
    alpha = np.stack([sway, moved.angles_rad[:, 1], theta[:, 2]], axis=1)
    return np.asarray(np.abs(alpha), dtype=np.float64)


def consensus(urgencies: tuple[float, ...], graph: Graph, rounds: int) -> list[list[Candidate]]:
    """Play an epoch; per iteration kappa = 0 ... rounds, what every node holds for the maximum."""
    nodes = [elect(board, urgency, rounds) for board, urgency in enumerate(urgencies)]
    history = [[node.best for node in nodes]]
    for _ in range(rounds):
        gossips = [node.gossip for node in nodes]
        for node, hears in zip(nodes, graph, strict=True):
            for neighbour in hears:
                node.hear(gossips[neighbour])
            node.advance()
        history.append([node.best for node in nodes])
    return history


def elect(board: int, urgency: float, rounds: int) -> Player:
    """One board at the beginning of epoch 3."""
    node = Player(board=board, period_ticks=PERIOD_TICKS, rounds=rounds)
    node.begin(3 * PERIOD_TICKS, urgency)
    return node


def elected(urgencies: tuple[float, ...], graph: Graph, rounds: int) -> list[int]:
    """Boards with y = 1 after an epoch of so many rounds."""
    own = [Candidate(urgency, board) for board, urgency in enumerate(urgencies)]
    last = consensus(urgencies, graph, rounds)[-1]
    return [board for board, best in enumerate(last) if best == own[board]]


def connected_graphs(size: int) -> list[tuple[Graph, int]]:
    """All connected undirected graphs of so many labelled nodes, and their diameters."""
    edges = list(combinations(range(size), 2))
    found = []
    for chosen in product([False, True], repeat=len(edges)):
        hops = np.where(np.eye(size, dtype=bool), 0.0, np.inf)
        for (i, j), there in zip(edges, chosen, strict=True):
            if there:
                hops[i, j] = hops[j, i] = 1.0
        graph = tuple(tuple(np.flatnonzero(row == 1.0).tolist()) for row in hops)
        for via in range(size):
            hops = np.minimum(hops, hops[:, via : via + 1] + hops[via : via + 1, :])
        if np.isfinite(hops).all():
            found.append((graph, int(hops.max())))
    return found


def test_auth_var() -> None:
    """eq. authVar: y_i(k) is 0 or 1, and one value for all of I_k.

    The interval is (k T_e, (k+1) T_e]; the protocol's two iterations are played at its beginning,
    so here it runs from one latch to the next.
    """
    enabled = run().enabled
    assert set(enabled.ravel().tolist()) == {0, 1}
    changes = np.flatnonzero(np.any(enabled[1:] != enabled[:-1], axis=1)) + 1
    assert set(changes.tolist()) <= set(latch_ticks())


def test_exclusive_y() -> None:
    """eq. exclusiveY: from the first election on, exactly one module is enabled at any time."""
    assert (run().enabled[ROUNDS:].sum(axis=1) == 1).all()


def test_y_is_one_for_all_before_the_first_election() -> None:
    """y_i(0) = 1 for all i: during warm-up and until the first latch, and not a tick longer."""
    records, _ = run_twin(load("paper", ["run.duration_s=0.2"]))
    first_latch = latch_ticks()[0]
    enabled = {r.tick: [decode(TorqueFrame, a).enabled for a in r.answers] for r in records}
    assert min(enabled) == -DELAY_TICKS
    assert all(enabled[tick] == [1, 1, 1] for tick in range(-DELAY_TICKS, first_latch))
    assert sum(enabled[first_latch]) == 1


def test_without_elections_all_stay_enabled() -> None:
    """The original DEC, to which the paper compares."""
    assert (run("election.enabled=false").enabled == 1).all()


def test_choose_y() -> None:
    """eq. chooseY: enabled is the module whose controlled variable has the largest error.

    Reckoned from the whole body at k T_e, as known then: one lumped delay old, and during the
    first delay that is the initial posture. Also for the references of the figure: upright.
    """
    moved = run()
    errors = errors_rad(moved)
    for tick in latch_ticks():
        w_0 = errors[max(0, tick - ROUNDS - DELAY_TICKS)]
        assert moved.enabled[tick].tolist() == [int(i == w_0.argmax()) for i in range(3)]
    assert (
        len(set(moved.enabled[ROUNDS:].argmax(axis=1).tolist())) > 1
    )  # It is not always the same.


def test_w_is_the_error_of_the_controlled_variable() -> None:
    """w_i0 is what chooseY says it is, in numbers: BS, KNEE and TS up to rounding.

    Each board sums angles in its own order; angles are below 1 rad, so 1e-14 is some 50 roundings.
    """
    moved = run()
    errors = errors_rad(moved)
    for epoch in range(EPOCHS):
        begin = epoch * PERIOD_TICKS
        assert moved.round[begin].tolist() == [0, 0, 0]
        w_0 = errors[max(0, begin - DELAY_TICKS)]
        assert np.abs(moved.urgency[begin] - w_0).max() < 1e-14


def test_cons_prot() -> None:
    """eq. consProt: w_i(kappa+1) is the maximum of w_j(kappa) over i and whom it hears.

    In every epoch of the twin, iteration by iteration, one a tick, to the bit.
    """
    moved = run()
    for epoch in range(EPOCHS):
        for kappa in range(ROUNDS):
            tick = epoch * PERIOD_TICKS + kappa
            before, after = moved.urgency[tick], moved.urgency[tick + 1]
            assert moved.epoch[tick + 1].tolist() == [epoch] * 3
            assert moved.round[tick + 1].tolist() == [kappa + 1] * 3
            heard = [max(before[j] for j in (i, *LINE[i])) for i in range(3)]
            assert after.tolist() == heard


def test_achieved_max_cons() -> None:
    """eq. achievedMaxCons: after two iterations every module of the paper's chain knows w*.

    And stays with it: nothing is played on until the next epoch.
    """
    moved = run()
    for epoch in range(EPOCHS):
        begin, end = epoch * PERIOD_TICKS, (epoch + 1) * PERIOD_TICKS
        largest = moved.urgency[begin].max()
        assert (moved.urgency[begin + ROUNDS : end] == largest).all()


@pytest.mark.parametrize("order", list(permutations((0.1, 0.2, 0.3))))
def test_proposition_1_kappa_bar_is_two(order: tuple[float, ...]) -> None:
    """Prop. 1, for the given topology: two iterations suffice, and one only for the middle."""
    history = consensus(order, LINE, rounds=ROUNDS)
    largest = Candidate(0.3, order.index(0.3))
    assert history[2] == [largest] * 3
    assert (history[1] == [largest] * 3) == (order.index(0.3) == 1)


@pytest.mark.parametrize("size", [2, 3, 4])
def test_proposition_1_holds_for_every_connected_topology(size: int) -> None:
    """Prop. 1: consensus after a number of steps that depends on the topology alone.

    It is the diameter: enough in all connected graphs of up to four modules, and one step less is
    not, for some place of the maximum.
    """
    for graph, diameter in connected_graphs(size):
        late = 0
        for order in permutations(range(1, size + 1)):
            urgencies = tuple(0.1 * rank for rank in order)
            history = consensus(urgencies, graph, rounds=diameter)
            assert {best.urgency for best in history[diameter]} == {max(urgencies)}
            late += len(set(history[diameter - 1])) > 1
        assert late > 0


urgencies_st = st.tuples(*[st.floats(0.0, 4.0)] * 3)


@settings(deadline=None)
@given(urgencies_st)
def test_compute_y(urgencies: tuple[float, ...]) -> None:
    """eq. computeY: y_i = 1 if and only if w_i0 = w*.

    Of several that are equal, which the paper excludes, it is the last in the chain alone.
    """
    largest = max(urgencies)
    winner = max(board for board, urgency in enumerate(urgencies) if urgency == largest)
    assert elected(urgencies, LINE, ROUNDS) == [winner]
    if urgencies.count(largest) == 1:
        assert [w == largest for w in urgencies] == [i == winner for i in range(3)]


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 4.0), min_size=2, max_size=7, unique=True))
def test_proposition_2(urgencies: list[float]) -> None:
    """Prop. 2: where no two w are equal, computeY implies exclusiveY; for chains of any length."""
    size = len(urgencies)
    line = tuple(tuple(j for j in (i - 1, i + 1) if 0 <= j < size) for i in range(size))
    assert len(elected(tuple(urgencies), line, size - 1)) == 1


def test_exclusive_y_does_not_need_assumption_2() -> None:
    """Equal errors, also all zero: still one module, and all agree on which."""
    for urgencies in ((0.0, 0.0, 0.0), (0.5, 0.5, 0.5), (0.5, 0.1, 0.5), (0.5, 0.5, 0.1)):
        assert len(elected(urgencies, LINE, ROUNDS)) == 1


def test_an_epoch_hears_nothing_of_another() -> None:
    """w^(k) is of epoch k (consProt's superscript): gossip that comes late does not elect."""
    node = elect(0, 0.1, ROUNDS)
    for epoch in (2, 4, -1):
        node.hear(Gossip(epoch, 0, Candidate(9.9, 1)))
    node.advance()
    assert node.best == Candidate(0.1, 0)
    node.hear(Gossip(3, 0, Candidate(9.9, 1)))
    node.advance()
    assert node.best == Candidate(9.9, 1)


@cache
def run_with_bare_servos() -> Trajectory:
    """With K_d, K_i and G_g at 0 a torque is -K_p epsilon, so epsilon shows, to the bit.

    The body does not balance like this, but it takes its time to fall. These references are near
    where it starts, so that errors overtake each other and every board wins and loses elections.
    """
    bare = [
        f"board.{board}.{setting}"
        for board in range(3)
        for setting in ("servo.kd_nm_s_rad=0", "servo.ki_per_s=0", "servo.gravity_weight=0")
    ]
    references = [f"board.{board}.reference_deg={deg}" for board, deg in enumerate((2, -6, 35))]
    moved = run("run.duration_s=0.6", "election.period_s=0.01", *bare, *references)
    assert moved.ending == "complete"
    return moved


def test_epsilon() -> None:
    """The paper's equation for epsilon: alpha - alpha_ref while y = 1, alpha - alpha_bar while
    y = 0, where alpha_bar is the alpha of the moment in which y went from 1 to 0."""
    moved = run_with_bare_servos()
    for i, board in enumerate(moved.scenario.boards):
        alpha_bar, was_enabled = np.nan, 1
        switched_off = 0
        for alpha, y, tau in zip(
            moved.controlled_rad[:, i], moved.enabled[:, i], moved.torques_nm[:, i], strict=True
        ):
            if was_enabled and not y:
                alpha_bar = alpha
                switched_off += 1
            was_enabled = y
            epsilon = alpha - board.reference_rad if y else alpha - alpha_bar
            assert tau == -board.servo.kp_nm_rad * epsilon
        assert switched_off >= 2


def test_epsilon_is_zero_at_the_moment_of_deactivation() -> None:
    """Where a board is switched off it holds on: its servo asks for nothing in that tick."""
    moved = run_with_bare_servos()
    ticks, boards = np.nonzero((moved.enabled[:-1] == 1) & (moved.enabled[1:] == 0))
    assert set(boards.tolist()) == {0, 1, 2}
    assert (moved.torques_nm[ticks + 1, boards] == 0.0).all()
    assert (moved.torques_nm[ticks, boards] != 0.0).all()
