"""The election as boards live it: S11, S12, and how often it fails on lossy links (issue 3)."""

import random
from collections import Counter
from math import sqrt

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from module_agent.firmware.config import ElectionConfig
from module_agent.firmware.consensus import MaxConsensus
from module_agent.firmware.controller import Candidate
from module_agent.firmware.election import Election, Gossip, HeardGossip
from module_agent.firmware.hearing import Hearing
from module_agent.firmware.link_model import LinkModel
from protocol.robot.events import (
    ANY,
    PERFECT,
    LinkOrder,
    LinkParameters,
    ReferenceOrder,
    encode_board_command,
)
from protocol.wire.frames import NO_TICK, LinkFrame, Neighbour, encode
from protocol.wire.wiring import neighbours
from tests.module_agent.robot import (
    DELAY_TICKS,
    PERIOD_TICKS,
    PROPORTIONAL,
    ROUNDS,
    RUN,
    Robot,
    still,
    torque,
)
from tests.module_agent.robot import config as board_config

pytestmark = pytest.mark.sampling

LAW = settings(max_examples=200, deadline=None, derandomize=True)
Z_99 = 2.576  # Half width of a 99 % interval, in standard deviations.
PERIOD = 10


def election(*, keeps_last: bool, rounds: int = 3, board: int = 1) -> Election:
    config = ElectionConfig(period_rounds=PERIOD, rounds=rounds, keeps_last=keeps_last)
    return Election(config, MaxConsensus(board_config(board)), board=board)


def heard(link: int, urgency: float, epoch: int = 0, round_: int = 0) -> HeardGossip:
    return HeardGossip(link, Gossip(epoch, round_, Candidate(urgency, 2 * link)))


# --- S11 and S12, one board ----------------------------------------------------------------------


@pytest.mark.parametrize("rounds", [1, 2, 5, 9])
def test_y_is_latched_at_the_end_of_the_last_round_and_at_no_other_time(rounds: int) -> None:
    """S11: in tick e T + R; in between it stays. It is 1 before the first latch."""
    knee = election(keeps_last=False, rounds=rounds)
    larger = [9.0, 0.0, 9.0, 9.0, 0.0]
    expected = True
    for tick in range(5 * PERIOD):
        epoch, round_ = divmod(tick, PERIOD)
        said = [heard(0, larger[epoch], epoch), heard(1, 0.1, epoch)]
        knee.tick(tick, 1.0, said, [0, 1])
        if round_ == rounds:
            expected = larger[epoch] < 1.0
        assert knee.enabled == expected, tick
    assert knee.incomplete_epochs == 0


def test_what_is_heard_when_an_epoch_begins_is_of_the_one_before() -> None:
    knee = election(keeps_last=False, rounds=PERIOD - 1)
    for tick in range(2 * PERIOD):
        late = [heard(0, 9.0, 0)] if tick >= PERIOD else []
        knee.tick(tick, 1.0, late, [])
    assert knee.enabled


HEARD = st.lists(
    st.tuples(st.integers(0, 1), st.integers(-1, 2), st.sampled_from([0.1, 9.0])), max_size=4
)
"""Of one tick: link, epoch, urgency."""


@LAW
@given(
    st.lists(HEARD, min_size=2 * PERIOD, max_size=2 * PERIOD),
    st.lists(st.sets(st.integers(0, 1)), min_size=2 * PERIOD, max_size=2 * PERIOD),
    st.booleans(),
)
def test_complete_means_heard_of_this_epoch_from_all_on_the_roster_in_each_round(
    ticks: list[list[tuple[int, int, float]]], rosters: list[set[int]], keeps_last: bool
) -> None:
    """S12, word for word; the roster is that of the round, and may change."""
    rounds = 3
    knee = election(keeps_last=keeps_last, rounds=rounds)
    y, incomplete = True, 0
    for tick, (arrivals, roster) in enumerate(zip(ticks, rosters, strict=True)):
        knee.tick(tick, 1.0, [heard(link, w, e) for link, e, w in arrivals], sorted(roster))
        epoch, round_ = divmod(tick, PERIOD)
        if round_ == rounds:
            played = range(epoch * PERIOD + 1, tick + 1)
            complete = all(
                rosters[t] <= {link for link, e, _ in ticks[t] if e == epoch} for t in played
            )
            elected = all(w < 1.0 for t in played for _, e, w in ticks[t] if e == epoch)
            incomplete += not complete
            if complete or not keeps_last:
                y = elected
        assert (knee.enabled, knee.incomplete_epochs) == (y, incomplete)


@pytest.mark.parametrize(("keeps_last", "after"), [(False, True), (True, False)])
def test_the_policies_differ_in_an_incomplete_epoch_only(keeps_last: bool, after: bool) -> None:
    """Epoch 0: the neighbour wins. Epoch 1: it is not heard. Epoch 2: heard, and it loses."""
    knee = election(keeps_last=keeps_last)
    y = []
    for tick in range(3 * PERIOD):
        epoch = tick // PERIOD
        said = [] if epoch == 1 else [heard(0, 9.0 if epoch == 0 else 0.1, epoch)]
        knee.tick(tick, 1.0, said, [0])
        if tick % PERIOD == PERIOD - 1:
            y.append(knee.enabled)
    assert y == [False, after, True]
    assert knee.incomplete_epochs == 1


def test_a_frame_of_an_earlier_round_counts_when_it_comes_late() -> None:
    """S12 asks for this epoch, not for this round: a delayed link is complete all the same."""
    knee = election(keeps_last=True)
    knee.tick(0, 1.0, [], [0])
    for tick in (1, 2, 3):
        knee.tick(tick, 1.0, [heard(0, 9.0, 0, 0)], [0])
    assert (knee.enabled, knee.incomplete_epochs) == (False, 0)


def test_a_board_that_nobody_is_beside_elects_itself() -> None:
    for keeps_last in (False, True):
        lone = election(keeps_last=keeps_last)
        lone.enabled = False
        for tick in range(4):
            lone.tick(tick, 0.0, [], [])
        assert (lone.enabled, lone.incomplete_epochs) == (True, 0)


@LAW
@given(st.lists(HEARD, min_size=30, max_size=30), st.booleans())
def test_a_tick_in_which_nothing_is_due_changes_nothing(
    ticks: list[list[tuple[int, int, float]]], keeps_last: bool
) -> None:
    """So a board need not even look at gossip then."""
    always, when_due = election(keeps_last=keeps_last), election(keeps_last=keeps_last)
    for tick, arrivals in enumerate(ticks):
        said = [heard(link, urgency, epoch) for link, epoch, urgency in arrivals]
        always.tick(tick, 1.0, said, [0, 1])
        if when_due.due(tick):
            when_due.tick(tick, 1.0, said, [0, 1])
        assert when_due.enabled == always.enabled
        assert when_due.incomplete_epochs == always.incomplete_epochs
        assert when_due.gossip == always.gossip


# --- Three boards on lossy links -----------------------------------------------------------------


class Chain:
    """The ears and the elections of three boards; frames are encoded and lost as in a run."""

    def __init__(self, *, standing: LinkParameters, rounds: int, seed: int, period: int) -> None:
        config = ElectionConfig(period, rounds, keeps_last=False)
        self.period = period
        self.elections = [
            Election(config, MaxConsensus(board_config(board)), board=board) for board in range(3)
        ]
        self.ears = [
            [
                Hearing(
                    LinkModel(seed=seed, sender=sender, receiver=receiver, standing=standing),
                    run_id=RUN,
                    boards=3,
                )
                for sender in neighbours(receiver, 3)
            ]
            for receiver in range(3)
        ]

    def epoch(self, epoch: int, urgencies: list[float]) -> list[bool]:
        """Play one epoch; who is enabled at its end."""
        for tick in range(epoch * self.period, (epoch + 1) * self.period):
            roster = Neighbour(1, tick - 1, 1)
            for one, ears, urgency in zip(self.elections, self.ears, urgencies, strict=True):
                arrived = [
                    HeardGossip(link, Gossip(f.epoch, f.round, Candidate(f.urgency, f.candidate)))
                    for link, ear in enumerate(ears)
                    for f in ear.take(tick, roster)
                ]
                one.tick(tick, urgency, arrived, range(len(ears)))
            for sender in range(3):
                self._say(tick, sender)
        return [one.enabled for one in self.elections]

    def _say(self, tick: int, sender: int) -> None:
        epoch, round_, (urgency, candidate) = self.elections[sender].gossip
        frame = LinkFrame(
            RUN, 1, tick, NO_TICK, epoch, round_, urgency, candidate, NO_TICK, *(0.0,) * 7
        )
        for receiver in neighbours(sender, 3):
            self.ears[receiver][neighbours(receiver, 3).index(sender)].put(encode(frame))


EPOCHS = 7000
"""So many that each of the three kinds has over 2,000."""


@pytest.mark.parametrize("p", [0.9, 0.8, 0.5])
def test_several_are_enabled_after_two_rounds_as_often_as_theory_says(p: float) -> None:
    """Issue 3, dec.md section 5: w at random, each frame heard with probability p.

    1 - (1 - q^2)^2 of the epochs; 1 - p^2 when maximum and runner-up sit at the two ends, since
    the one has to reach the other in exactly two hops. Within the binomial 99 % interval.
    """
    chance = random.Random(f"urgencies {p}")
    chain = Chain(standing=PERFECT._replace(loss=1.0 - p), rounds=2, seed=11, period=3)
    epochs: Counter[str] = Counter()
    several: Counter[str] = Counter()
    for epoch in range(EPOCHS):
        urgencies = [chance.random() for _ in range(3)]
        enabled = chain.epoch(epoch, urgencies)
        _, runner_up, winner = sorted(range(3), key=urgencies.__getitem__)
        assert enabled[winner], "the failure is several, never none"
        kind = "middle" if winner == 1 else "end" if runner_up == 1 else "two ends"
        epochs[kind] += 1
        several[kind] += sum(enabled) > 1
    q = 1.0 - p
    for kind, trials in epochs.items():
        assert trials >= 2000
        expected = 1.0 - p * p if kind == "two ends" else 1.0 - (1.0 - q * q) ** 2
        margin = Z_99 * sqrt(expected * (1.0 - expected) / trials)
        assert abs(several[kind] / trials - expected) <= margin, kind


def test_more_rounds_make_failures_rare() -> None:
    """At 20 % loss: each round more is another chance, so the rate falls about as fast as q."""
    shares = []
    for rounds in (2, 3, 5, 8):
        chance = random.Random(rounds)
        chain = Chain(standing=PERFECT._replace(loss=0.2), rounds=rounds, seed=3, period=9)
        several = 0
        for epoch in range(700):
            several += sum(chain.epoch(epoch, [chance.random() for _ in range(3)])) > 1
        shares.append(several / 700)
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 0.1
    assert shares[-1] < 0.005


def test_without_loss_exactly_one_is_enabled_ties_included() -> None:
    """S13."""
    chance = random.Random(4)
    chain = Chain(standing=PERFECT, rounds=2, seed=1, period=3)
    for epoch in range(500):
        urgencies = [chance.choice([0.0, 0.5, 1.0]) for _ in range(3)]
        enabled = chain.epoch(epoch, urgencies)
        winner = max(range(3), key=lambda i: (urgencies[i], i))
        assert enabled == [board == winner for board in range(3)]


# --- Whole boards: cut links ---------------------------------------------------------------------


def bad_link(sender: int, **changes: float) -> bytes:
    return encode_board_command(LinkOrder(sender, PERFECT._replace(**changes)))


CUT, HEALED = 2 * PERIOD_TICKS + 5, 5 * PERIOD_TICKS + 5


def run(robot: Robot, given: dict[int, dict[int, bytes]]) -> dict[int, list[int]]:
    """Ticks to who is enabled; `given` are commands by tick and board."""
    enabled = {}
    for tick in range(-DELAY_TICKS, 7 * PERIOD_TICKS):
        acts = robot.tick(tick, given.get(tick))
        enabled[tick] = [torque(act).enabled for act in acts]
    return enabled


@pytest.mark.parametrize(
    ("keeps_last", "meanwhile"), [(False, [0, 1, 1]), (True, [0, 0, 1])], ids=["each", "keep"]
)
def test_a_cut_chain_follows_its_policy_and_is_one_again_after_healing(
    keeps_last: bool, meanwhile: list[int]
) -> None:
    """S12: ankle-knee-hip, cut above the knee; the hip leads. One winner within the next epoch."""
    config = Robot().boards[0].config.election
    assert config is not None
    robot = Robot(sensors=still, election=config._replace(keeps_last=keeps_last))
    second_to_the_hip = encode_board_command(ReferenceOrder(0.4))
    enabled = run(
        robot,
        {
            0: {1: second_to_the_hip},
            CUT: {1: bad_link(2, cut=1.0), 2: bad_link(1, cut=1.0)},
            HEALED: {1: bad_link(2), 2: bad_link(ANY)},
        },
    )
    assert enabled[CUT] == [0, 0, 1]
    for epoch in (3, 4, 5):
        assert enabled[epoch * PERIOD_TICKS + ROUNDS] == meanwhile
    assert enabled[6 * PERIOD_TICKS + ROUNDS] == [0, 0, 1]
    counts = [one.election.incomplete_epochs for one in robot.boards if one.election is not None]
    assert counts == [0, 3, 3]


def test_a_command_is_obeyed_in_the_tick_of_the_observation_that_carries_it() -> None:
    """S14, S15: the frame said in the tick before is lost already."""
    robot = Robot()
    for tick in range(-DELAY_TICKS, 10):
        acts = robot.tick(tick, {1: bad_link(0, cut=1.0)} if tick == 5 else None)
        masks = [use.heard_mask for use in torque(acts[1]).links]
        assert masks == [int(-DELAY_TICKS < tick < 5), int(tick > -DELAY_TICKS)]


def test_a_new_reference_is_what_an_enabled_board_moves_to() -> None:
    robot = Robot(gains=PROPORTIONAL, sensors=still)
    command = encode_board_command(ReferenceOrder(0.2))
    for tick in range(-DELAY_TICKS, PERIOD_TICKS):
        hip = torque(robot.tick(tick, {2: command} if tick == 20 else None)[2])
        if tick >= ROUNDS:
            assert hip.torque_nm == -100.0 * (hip.controlled_rad - (0.2 if tick >= 20 else 0.0))


def test_a_one_way_link_is_noticed_by_the_side_that_is_not_heard() -> None:
    """The knee hears no ankle, and says so in each frame; the ankle counts, the robot goes on."""
    robot = Robot()
    unheard = []
    for tick in range(-DELAY_TICKS, 400):
        given = {20: {1: bad_link(0, cut=1.0)}, 350: {1: bad_link(0)}}.get(tick)
        acts = robot.tick(tick, given)
        ankle, knee, hip = (torque(act) for act in acts)
        if tick > 2 - DELAY_TICKS:
            unheard.append(ankle.links[0].unheard_ticks)
            others = [*knee.links, *hip.links]
            assert [use.unheard_ticks for use in others] == [0] * len(others)
    at = dict(zip(range(3 - DELAY_TICKS, 400), unheard, strict=True))
    assert [at[tick] for tick in (20, 21, 22, 23, 41, 276, 349)] == [0, 1, 2, 3, 21, 255, 255]
    assert at[351] == at[399] == 0
    assert robot.boards[0].hearings[0].heard_mask == 1, "the other direction works"


def test_garbage_for_a_command_is_counted_and_changes_nothing() -> None:
    robot, untouched = Robot(), Robot()
    for tick in range(-DELAY_TICKS, 30):
        acts = robot.tick(tick, {1: b"\xc1garbage"} if tick == 7 else None)
        plain = untouched.tick(tick)
        assert [act.links for act in acts] == [act.links for act in plain]
        same = [torque(act)._replace(counted=0) for act in acts]
        assert same == [torque(act)._replace(counted=0) for act in plain]
    assert dict(robot.boards[1].refused) == {"malformed": 1}
