"""Own time: how a board on a clock of its own counts, and how that is told to others.

Inside the board a tick is a slot: one of its own periods, numbered by the plant's ticks: slot s
begins with tick s * (ticks per period). Delay line, integrator and extrapolation count in slots. On
the wire ticks are the plant's. Here, and nowhere else, the one becomes the other.

The lumped delay is from the sensor to the joint. One period of it goes by on the way, between the
sample's arrival and the torque's effect; the delay line has the rest, in whole periods, at least 1.
"""

from dataclasses import replace

from module_agent.firmware.config import BoardConfig
from protocol.robot.cadence import Cadence
from protocol.robot.hardware import STEADY
from protocol.wire.frames import NO_TICK, LinkFrame, Observation


class OwnTime:
    """Slots of one board, and ticks of the plant."""

    def __init__(self, config: BoardConfig) -> None:
        assert config.cadence is not None, "the scenario is one of realtime"
        self.cadence: Cadence = config.cadence
        self.ticks_per_period = self.cadence.ticks_per_period[config.index]
        self.config = self._in_own_periods(config)
        """The same board with all times in its own periods, and those of elections in rounds."""
        self._epoch_ticks = 0 if config.election is None else config.election.period_rounds

    def _in_own_periods(self, config: BoardConfig) -> BoardConfig:
        period, election = self.ticks_per_period, config.election
        if election is not None:
            rounds = election.period_rounds // self.cadence.ticks_per_round
            election = election._replace(period_rounds=rounds)
        return replace(
            config,
            tick_s=config.tick_s * period,
            lumped_delay_ticks=max(1, config.lumped_delay_ticks // period - 1),
            election=election,
            clock=STEADY,  # Whoever drives the board has the clock, with all that is wrong with it.
        )

    def plant_tick(self, slot: int) -> int:
        """The plant's tick with which a slot begins."""
        return slot * self.ticks_per_period

    def slot(self, tick: int) -> int:
        """The slot that one of the plant's ticks is in."""
        return tick // self.ticks_per_period

    def whole_periods(self, ticks: int) -> int:
        """So many own periods make up for a delay: rounded up."""
        return -(-ticks // self.ticks_per_period)

    def round(self, slot: int) -> int:
        """The round of the elections that a slot is in, numbered alike by every board.

        What is left of an epoch that is no whole number of rounds belongs to its last one.
        """
        if self._epoch_ticks == 0:
            return slot
        epoch, ticks = divmod(self.plant_tick(slot), self._epoch_ticks)
        rounds = self._epoch_ticks // self.cadence.ticks_per_round
        return epoch * rounds + min(ticks // self.cadence.ticks_per_round, rounds - 1)

    def observation(self, observation: Observation) -> Observation:
        """An observation with the slot in which the plant took it. Its command is obeyed apart."""
        return observation._replace(tick=self.slot(observation.tick), command=b"")

    def heard(self, frame: LinkFrame) -> LinkFrame:
        """A neighbour's frame with its sample in own periods: in the nearest one."""
        period = self.ticks_per_period
        if frame.sample_tick == NO_TICK:
            return frame
        return frame._replace(sample_tick=(frame.sample_tick + period // 2) // period)

    def said(self, frame: LinkFrame) -> LinkFrame:
        """A frame of this board's as it goes out."""
        sample_tick = frame.sample_tick
        if sample_tick != NO_TICK:
            sample_tick = self.plant_tick(sample_tick)
        return frame._replace(tick=self.plant_tick(frame.tick), sample_tick=sample_tick)
