"""The plant's clock as a board knows it, over lost and late observations and a drifting clock."""

from random import Random

import pytest

from module_agent.firmware.own_time.plant_clock import LATE_NS, PlantClock

TICK_NS = 1_000_000
EPOCH_TICKS = 100
LATENCY_NS = 200_000
BOOTED_NS = 5_000_000_000_000


class OwnClock:
    """A board's clock: it was started some time, and it is fast or slow."""

    def __init__(self, ppm: float) -> None:
        self.ppm = ppm

    def at(self, plant_ns: int) -> int:
        return BOOTED_NS + plant_ns + round(plant_ns * self.ppm * 1e-6)


def played(ppm: float, *, seconds: int = 30, loss: float = 0.0, seed: int = 1) -> list[float]:
    """Errors of the estimate, in ticks, once a tick; observations are late by at least 0.2 ms."""
    random, own, clock = Random(seed), OwnClock(ppm), PlantClock(tick_ns=TICK_NS)
    errors, silent_until = [], 0
    clock.hear(0, own.at(LATENCY_NS))
    for tick in range(1, seconds * 1000):
        if random.random() < 0.0005:
            silent_until = tick + random.randrange(
                1000
            )  # The plant, or the cable, is gone for a while.
        if tick >= silent_until and random.random() >= loss:
            late_ns = LATENCY_NS + round(random.expovariate(1 / 300_000))
            clock.hear(tick, own.at(tick * TICK_NS + late_ns))
        errors.append(clock.tick_at(own.at(tick * TICK_NS + 900_000)) - tick - 0.9)
    return errors


@pytest.mark.parametrize("ppm", [0.0, 500.0, -500.0])
@pytest.mark.parametrize("loss", [0.0, 0.3, 0.9])
def test_neither_loss_nor_drift_moves_it_by_a_tick(ppm: float, loss: float) -> None:
    """Latency is taken for no time; drift goes unnoticed for as long as nothing comes, or 0.5 s."""
    errors = played(ppm, loss=loss)
    assert max(errors) < 0.8
    assert min(errors) > -1.1


@pytest.mark.parametrize("ppm", [500.0, -500.0])
def test_a_board_is_in_the_right_epoch(ppm: float) -> None:
    """But for the tick around its border: nobody can know that more exactly than an observation."""
    random, own, clock = Random(2), OwnClock(ppm), PlantClock(tick_ns=TICK_NS)
    wrong = 0
    for tick in range(60_000):
        if random.random() >= 0.5 and not 20_000 < tick < 23_000:
            clock.hear(tick, own.at(tick * TICK_NS + LATENCY_NS))
        if 2 <= tick % EPOCH_TICKS < EPOCH_TICKS - 2:
            wrong += clock.tick_at(own.at(tick * TICK_NS)) // EPOCH_TICKS != tick // EPOCH_TICKS
    assert wrong == 0, "nor when nothing is heard for three seconds"


def test_what_comes_a_little_late_changes_nothing() -> None:
    clock = PlantClock(tick_ns=TICK_NS)
    clock.hear(0, LATENCY_NS)
    before = clock.tick_at(100 * TICK_NS)
    clock.hear(1, 5 * TICK_NS)
    clock.hear(2, LATE_NS)
    assert clock.tick_at(100 * TICK_NS) == before


def test_a_plant_that_is_behind_is_followed_and_is_on_time_again() -> None:
    clock = PlantClock(tick_ns=TICK_NS)
    for tick in range(1000):
        clock.hear(tick, tick * TICK_NS)
    clock.hear(1000, 1080 * TICK_NS)
    assert clock.tick_at(1080 * TICK_NS) == 1000 + LATE_NS // TICK_NS
    for tick in range(1001, 1101):
        clock.hear(tick, 1080 * TICK_NS + (tick - 1000) * TICK_NS // 5)
    assert clock.tick_at(1101 * TICK_NS) == 1101.0


@pytest.mark.parametrize("speed", [0.9, 0.5, 0.1])
def test_a_plant_that_goes_slower_is_followed(speed: float) -> None:
    clock = PlantClock(tick_ns=TICK_NS)
    for tick in range(3000):
        now_ns = round(tick * TICK_NS / speed)
        clock.hear(tick, now_ns)
        assert 0.0 <= clock.tick_at(now_ns) - tick <= LATE_NS / TICK_NS + 1e-6
