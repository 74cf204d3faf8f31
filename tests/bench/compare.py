"""What has become better or worse since an earlier run of the bench.

A figure has changed when its median moved by more than `CHANGE` and no repeat of one run lies
within the range of the other, given enough repeats to speak of a range. Between different machines
only ratios are compared.
"""

from collections.abc import Iterator
from typing import NamedTuple

from tests.bench.registry import kind_of
from tests.bench.results import Results
from tests.bench.spread import Spread

CHANGE = 0.05
REPEATS_MIN = 3
SAME_MACHINE = ("processor", "cores", "system")


class Change(NamedTuple):
    """One figure then and now."""

    group: str
    name: str
    figure: str
    then: Spread
    now: Spread
    verdict: str
    """`better`, `worse` or `same`."""

    @property
    def factor(self) -> float:
        """The median now over the median then."""
        return self.now.median / self.then.median if self.then.median else 1.0


def compare(then: Results, now: Results) -> list[Change]:
    """Compare every figure that both have, in the order of the new ones."""
    absolute = all(then.machine.get(key) == now.machine.get(key) for key in SAME_MACHINE)
    return list(_changes(then, now, absolute=absolute))


def _changes(then: Results, now: Results, *, absolute: bool) -> Iterator[Change]:
    for group_name, group in now.groups.items():
        before = then.groups.get(group_name)
        if before is None:
            continue
        for name, entry in group.entries.items() if absolute else ():
            old = before.entries.get(name)
            for figure in entry.figures:
                if old is not None and old.values(figure):
                    yield _change(
                        group_name, name, figure, old.spread(figure), entry.spread(figure)
                    )
        for name, ratio in group.ratios.items():
            if name in before.ratios:
                yield _change(
                    group_name,
                    f"ratio: {name}",
                    ratio.figure,
                    before.ratios[name].spread(),
                    ratio.spread(),
                )


def _change(group: str, name: str, figure: str, then: Spread, now: Spread) -> Change:
    verdict = "same"
    moved = abs(now.median - then.median) > CHANGE * abs(then.median)
    enough = min(then.of, now.of) >= REPEATS_MIN
    if moved and enough and then.apart(now):
        better = (now.median > then.median) == kind_of(figure).more_is_better
        verdict = "better" if better else "worse"
    return Change(group, name, figure, then, now, verdict)
