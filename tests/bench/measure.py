"""Measuring: every contender of a group in turn, repeat after repeat, with a word on each."""

import os
import time
from collections.abc import Callable

from tests.bench.children import UnavailableError
from tests.bench.registry import Contender, Group, kind_of
from tests.bench.results import Entry, GroupResult

FAILURES_MAX = 2
"""After so many failures a contender is left out."""

Tell = Callable[[str], None]


def measure(group: Group, repeats: int, tell: Tell) -> GroupResult:
    """Measure a group. What is not here, or does not work, is left out and says so."""
    result = GroupResult(group.title, load=[os.getloadavg()[0]])
    started = time.perf_counter()
    failures: dict[str, int] = {}
    for round_ in range(repeats):
        for contender in group.contenders:
            if contender.name not in result.missing:
                tell(f"{group.name} {round_ + 1}/{repeats}: {contender.name}")
                _once(contender, round_, result, failures, tell)
    result.relate(group.ratios)
    result.load.append(os.getloadavg()[0])
    result.seconds = time.perf_counter() - started
    return result


def _once(
    contender: Contender, round_: int, result: GroupResult, failures: dict[str, int], tell: Tell
) -> None:
    try:
        figures = contender.measure()
    except UnavailableError as error:
        result.missing[contender.name] = str(error)
        tell(f"  skipped, {error}")
        return
    except Exception as error:  # noqa: BLE001 - whatever it is, what else was measured stays.
        failures[contender.name] = failures.get(contender.name, 0) + 1
        tell(f"  failed, {error!r}")
        if failures[contender.name] == FAILURES_MAX:
            result.missing[contender.name] = f"failed: {error!r}"
            result.entries.pop(contender.name, None)
        return
    result.entries.setdefault(contender.name, Entry()).repeats[round_] = figures
    name, value = next(iter(figures.items()))
    kind = kind_of(name)
    tell(f"  {value:,.{kind.decimals}f} {kind.label}")
