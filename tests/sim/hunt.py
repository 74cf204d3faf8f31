"""One seed: safety while everything goes wrong, then everything heals and liveness is asked for.

find(seed)      plays it and returns what was seen, or the law that was broken
"""

import hashlib
from math import fabs
from typing import NamedTuple

from module_agent.firmware.sensing import BACK_TICKS, HOLD_TICKS_MAX
from plant_server.session.record import TickRecord
from protocol.robot.states import State
from protocol.wire.frames import TorqueFrame, decode
from tests.sim.broken import BrokenLawError
from tests.sim.laws import Laws, law
from tests.sim.plans import Plan, plan
from tests.sim.robot import Robot

SENSORS_BACK_TICKS = HOLD_TICKS_MAX + 1 + BACK_TICKS
"""A sensor that is whole again may jump to the truth: it is not believed, and given up first."""
FLAILS_RAD_S = 40.0
"""Up to here `module_agent.firmware.plausibility` accuses no sensor that works."""
DRAIN_TICKS_MAX = 1000
"""Within so many ticks all commands are carried out that a run can have left."""
COMPARED_EVERY = 8
"""One seed of so many is played again without noise."""


class Found(NamedTuple):
    """What became of a seed."""

    seed: int
    ticks: int
    digest: str
    """Of everything recorded."""
    fell: bool
    claimed_epochs: int
    """How often S13 was claimed."""
    broken: str = ""
    """The tick and the law, if one was broken."""


class Game:
    """One run of a plan."""

    def __init__(self, plan: Plan, *, quiet: bool = False) -> None:
        self.plan = plan
        self.robot = Robot(plan, quiet=quiet)
        self.laws = Laws(self.robot)
        self.records: list[TickRecord] = []
        self.said: dict[int, TorqueFrame] = {}

    def play(self) -> None:
        """Play it to the end, or until the body falls."""
        lockstep, until = self.robot.twin.lockstep, self.plan.faulty_ticks
        while lockstep.plant.tick < until and not lockstep.plant.over:
            self._tick()
        self.robot.heal()
        drained = lockstep.plant.tick + DRAIN_TICKS_MAX
        while not self.robot.healed and not lockstep.plant.over:
            law(lockstep.plant.tick < drained, "commands are carried out in the end")
            self._tick()
        if not lockstep.plant.over:
            self._live()

    def _live(self) -> None:
        """One epoch after the delay lines are full, one board is enabled and all are running.

        They are filled by sensors that are back.
        """
        scenario, agreement = self.plan.scenario, self.laws.agreement
        lockstep = self.robot.twin.lockstep
        delay_ticks = max(board.lumped_delay_ticks for board in scenario.boards)
        full_tick = lockstep.plant.tick + SENSORS_BACK_TICKS + delay_ticks
        period_ticks = agreement.period_ticks
        begins_tick = -(-full_tick // period_ticks) * period_ticks
        latch_tick = begins_tick + agreement.rounds
        # A board that reckons no longer passes over samples (`BodyView.for_below`); the gap goes
        # through the delay line of the boards below, which may be longer than an epoch.
        settled_tick = full_tick + max(period_ticks, delay_ticks)
        last_tick = max(latch_tick, settled_tick) + period_ticks
        flailed = False
        while lockstep.plant.tick <= last_tick and not lockstep.plant.over:
            self._tick()
            tick = lockstep.plant.tick - 1
            flailed |= self._flails()
            states = {board: State(frame.state).name for board, frame in self.said.items()}
            if lockstep.plant.over or (flailed and State.SAFE.name in states.values()):
                return
            if tick >= latch_tick:
                enabled = [board for board, frame in self.said.items() if frame.enabled]
                law(len(enabled) == 1, "one board is enabled once all is healed", enabled)
            if tick >= settled_tick:
                running = set(states.values()) == {"RUNNING"}
                law(running and len(states) == lockstep.plant.size, "all are running", states)

    def _flails(self) -> bool:
        """Whether a joint turns so fast that its sensors are accused though they work."""
        return any(
            fabs(rate) > FLAILS_RAD_S for rate in self.robot.twin.lockstep.plant.body.rates_rad_s
        )

    def _tick(self) -> None:
        record = self.robot.tick()
        self.records.append(record)
        self.said = self.laws.check(record)

    def motion(self) -> list[tuple[object, ...]]:
        """What noise must not change: the motion, and what moved it."""
        return [
            (
                record.tick,
                record.angles_rad,
                record.rates_rad_s,
                record.torques_nm,
                record.events,
                [decode(TorqueFrame, said)[3:11] if said else None for said in record.answers],
            )
            for record in self.records
        ]


def find(seed: int) -> Found:
    """Play a seed; never raises."""
    game = Game(plan(seed))
    broken = _broken(game)
    if not broken and seed % COMPARED_EVERY == 0:
        quiet = Game(game.plan, quiet=True)
        broken = _broken(quiet)
        if not broken and repr(quiet.motion()) != repr(game.motion()):
            broken = _difference(game, quiet)
    return Found(
        seed=seed,
        ticks=len(game.records),
        digest=hashlib.sha256(repr(game.records).encode()).hexdigest(),
        fell=game.robot.twin.lockstep.plant.body.fallen,
        claimed_epochs=game.laws.agreement.claimed_epochs,
        broken=broken,
    )


def _broken(game: Game) -> str:
    try:
        game.play()
    except BrokenLawError as error:
        return f"tick {game.robot.twin.lockstep.plant.tick}: {error}"
    except Exception as error:  # noqa: BLE001 - whatever it is, it should not have happened.
        return f"tick {game.robot.twin.lockstep.plant.tick}: raised {error!r}"
    return ""


def _difference(game: Game, quiet: Game) -> str:
    pairs = zip(game.motion(), quiet.motion(), strict=False)
    tick = next((str(a[0]) for a, b in pairs if repr(a) != repr(b)), "the end")
    return f"tick {tick}: noise changes nothing: another motion than without it"
