"""Measuring what T_e decides: Table II's indices and the energy over the election period.

The paper does not print T_e. Here the same run is played in the twin with one T_e after another,
and once without elections (the original controller, where all boards move), for comparison.

Rule: a row is a run, so it can be had again with `decmesh run`, to the bit.
"""

import csv
from collections.abc import Iterable, Sequence
from math import floor, log10
from pathlib import Path
from typing import Any, NamedTuple

from deploy.launch.twin import run_twin
from deploy.outcome.summary import Summary, summary
from deploy.recording.trajectory import trajectory
from deploy.scenario_file.load import load
from deploy.scenario_file.ticks import whole_ticks
from protocol.robot.scenario import ScenarioError

SCENARIO = "paper"
CSV = "te.csv"
STEPS = (1, 1.1, 1.2, 1.4, 1.6, 1.8, 2, 2.2, 2.5, 2.8, 3.2, 3.6, 4, 4.5, 5, 5.6, 6.3, 7, 8, 9)
"""Twenty to a decade, about as far apart on a logarithmic scale, with few digits."""
VALUES_MAX = 200


class PeriodCase(NamedTuple):
    """One run."""

    period_s: float | None
    """T_e; None: without elections."""
    settings: tuple[str, ...]
    """As of `--set`, beside T_e."""

    @property
    def all_settings(self) -> list[str]:
        """What `--set` makes of the scenario to get this run."""
        elects = (
            "election.enabled=false"
            if self.period_s is None
            else f"election.period_s={self.period_s}"
        )
        return [*self.settings, elects]


class PeriodResult(NamedTuple):
    """What came of a run."""

    period_s: float | None
    summary: Summary
    """As in `summary.json`."""


def periods_s(text: str, *, tick_s: float) -> list[float]:
    """Read `0.05,0.1,0.2`, or `0.02:1` for both ends and the `STEPS` of whole ticks between them.

    Raises ValueError, with a line for the user.
    """
    first, colon, last = text.partition(":")
    if not colon:
        return sorted({_seconds(word) for word in text.split(",")})
    low, high = _seconds(first), _seconds(last)
    if not low < high:
        raise ValueError(f"{text!r}: a range goes from the shorter to the longer time")
    decades = range(floor(log10(low)), floor(log10(high)) + 1)
    steps = [float(f"{step}e{decade}") for decade in decades for step in STEPS]
    whole = [value for value in steps if low < value < high and _is_whole(value, tick_s)]
    return [low, *whole, high]


def grid(values_s: Sequence[float], settings: Sequence[str]) -> list[PeriodCase]:
    """The run without elections, and one for each T_e. Raises `ScenarioError` with all mistakes."""
    if len(values_s) > VALUES_MAX:
        raise ScenarioError(f"{len(values_s)} values of T_e; at most {VALUES_MAX} at a time")
    cases = [PeriodCase(period_s, tuple(settings)) for period_s in (None, *values_s)]
    complaints: dict[str, None] = {}
    for case in cases:
        try:
            load(SCENARIO, case.all_settings)
        except ScenarioError as error:
            complaints |= dict.fromkeys(str(error).splitlines())
    if complaints:
        raise ScenarioError("\n".join(complaints))
    return cases


def measure(case: PeriodCase) -> PeriodResult:
    """Run one case in the twin."""
    scenario = load(SCENARIO, case.all_settings)
    run = trajectory(scenario, *run_twin(scenario))
    return PeriodResult(case.period_s, summary(run, mode="twin"))


def in_order(results: Iterable[PeriodResult]) -> list[PeriodResult]:
    """Without elections first, then by T_e."""
    return sorted(results, key=lambda result: result.period_s or 0.0)


def write_csv(results: Sequence[PeriodResult], path: Path) -> None:
    """Write one line per run. Raises OSError."""
    with path.open("w", encoding="utf-8", newline="") as file:
        lines = [_flat(result) for result in results]
        writer = csv.DictWriter(file, lines[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def _seconds(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise ValueError(f"{word.strip()!r} is no time in seconds; write it like 0.1")
    return value


def _is_whole(period_s: float, tick_s: float) -> bool:
    return whole_ticks(period_s * 1e3, tick_s * 1e3) is not None


def _flat(result: PeriodResult) -> dict[str, Any]:
    """One row: `TS_overshoot_deg`, `energy_positive_j`, `epochs`, ..."""
    found = result.summary
    row: dict[str, Any] = {"period_s": result.period_s, "ending": found["ending"]}
    row["ended_s"] = found["simulated_s"]
    for name, indices in found["indices"].items():
        row |= {f"{name}_{key}": value for key, value in indices.items()}
    row |= {f"energy_{key}_j": value for key, value in found["energy_j"].items()}
    row["state_sha256"] = found["state_sha256"]
    consensus = found["consensus"] or {}
    for key in ("epochs", "enabled_0", "enabled_1", "enabled_2_or_more"):
        row[key] = consensus.get(key)
    return row
