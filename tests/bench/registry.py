"""What is measured: groups of contenders, each run in turn, A B A B, in every repeat.

A contender is measured once per repeat and gives figures by name; the first is its main one. A
figure's name ends in its unit. What two contenders of a group are to each other is a ratio of
figures of the same repeat, so that both have seen the same machine.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

Figures = dict[str, float]


class Settings(NamedTuple):
    """How thorough a measurement is."""

    repeats: int
    warm_up: int
    """Ticks before the first that counts."""
    ticks: int
    boards_max: int
    """How far growth is followed in the twin."""


FULL = Settings(repeats=5, warm_up=1000, ticks=5000, boards_max=1000)
QUICK = Settings(repeats=3, warm_up=200, ticks=1000, boards_max=100)


class Contender(NamedTuple):
    """Something that can be measured; `measure` may raise `children.UnavailableError`."""

    name: str
    measure: Callable[[], Figures]


class Ratio(NamedTuple):
    """One contender's figure over another's; decmesh is above wherever it is one of them."""

    name: str
    above: str
    below: str
    figure: str


class Group(NamedTuple):
    """What is measured in turn and shown together."""

    name: str
    title: str
    contenders: list[Contender]
    ratios: Sequence[Ratio] = ()


class Kind(NamedTuple):
    """How a figure is shown and compared."""

    label: str
    decimals: int
    more_is_better: bool = False


KINDS = {
    "ticks_per_s": Kind("ticks/s", 0, more_is_better=True),
    "p50_us": Kind("p50 of a tick, µs", 0),
    "p99_us": Kind("p99 of a tick, µs", 0),
    "cpu_us": Kind("CPU time per tick, all processes, µs", 0),
    "us_per_board": Kind("per board and tick, µs", 1),
    "us_per_tick": Kind("per tick, µs", 1),
    "error_rad": Kind("off after 1 s, rad", 9),
    "seconds": Kind("s", 3),
    "notice_s": Kind("killed until the plant says so, s", 4),
    "tick_us": Kind("whole tick, µs", 1),
    "open_us": Kind("plant opens the tick, puts observations up to this board's, µs", 1),
    "there_us": Kind("observation on its way, waking the board, µs", 1),
    "neighbours_us": Kind("board waits for its neighbours' frames, µs", 1),
    "think_us": Kind("board thinks, µs", 1),
    "say_us": Kind("board puts its link frames and its torque, µs", 1),
    "back_us": Kind("torque on its way, waking the plant, other answers read before it, µs", 1),
    "close_us": Kind("plant reads the answer, integrates, closes, µs", 1),
    "missed_share": Kind("share of deadlines missed", 4),
    "observation_age_ms_p50": Kind("age of an observation in use, worst board, p50, ms", 2),
    "observation_age_ms_p99": Kind("the same, p99, ms", 2),
    "torque_age_ms_p50": Kind("age of a torque in use, worst board, p50, ms", 2),
    "torque_age_ms_p99": Kind("the same, p99, ms", 2),
    "decision_ms_p50": Kind("epoch's start to a decision, worst board, p50, ms", 2),
    "decision_ms_p99": Kind("the same, p99, ms", 2),
    "s_per_s": Kind("s of the wall per s of the body", 3),
    "ratio": Kind("ratio", 2, more_is_better=True),
    "resident_mb": Kind("resident, MB", 1),
    "own_mb": Kind("of which not shared, MB", 1),
}


def kind_of(figure: str) -> Kind:
    """How a figure is shown; one that nobody has described is shown by its name."""
    return KINDS.get(figure, Kind(figure, 3))
