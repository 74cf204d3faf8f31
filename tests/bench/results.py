"""What was measured, as one JSON file: every repeat of every figure, on what machine, with what."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from tests.bench.registry import Figures, Ratio
from tests.bench.spread import Spread, spread

FORMAT = 1


@dataclass(slots=True)
class Entry:
    """What one contender has given, by the number of the repeat; one that failed is not there."""

    repeats: dict[int, Figures] = field(default_factory=dict)

    @property
    def figures(self) -> list[str]:
        """Names of its figures, the main one first."""
        return list(next(iter(self.repeats.values())))

    def values(self, figure: str) -> dict[int, float]:
        """A figure by repeat."""
        return {n: found[figure] for n, found in self.repeats.items() if figure in found}

    def spread(self, figure: str) -> Spread:
        """Median and range of a figure."""
        return spread(list(self.values(figure).values()))


@dataclass(slots=True)
class Related:
    """A ratio of two contenders."""

    figure: str
    """Of which figure, which says whether more is better."""
    values: list[float]

    def spread(self) -> Spread:
        """Median and range."""
        return spread(self.values)


@dataclass(slots=True)
class GroupResult:
    """One group: its contenders, and why some of them have nothing to show."""

    title: str
    load: list[float] = field(default_factory=list)
    """Load of the machine, mean of a minute, before and after."""
    seconds: float = 0.0
    entries: dict[str, Entry] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    ratios: dict[str, Related] = field(default_factory=dict)

    def relate(self, ratios: Sequence[Ratio]) -> None:
        """Divide what was measured in the same repeat."""
        for name, above, below, figure in ratios:
            if above in self.entries and below in self.entries:
                under = self.entries[below].values(figure)
                values = self.entries[above].values(figure)
                if found := [value / under[n] for n, value in values.items() if n in under]:
                    self.ratios[name] = Related(figure, found)


@dataclass(slots=True)
class Results:
    """A whole run of the bench."""

    machine: dict[str, Any]
    settings: dict[str, Any]
    groups: dict[str, GroupResult] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write everything down."""
        path.write_text(json.dumps({"format": FORMAT, **asdict(self)}, indent=1) + "\n")

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read what `write` has written. Raises OSError, or ValueError if it is something else."""
        try:
            tree = json.loads(path.read_bytes())
            assert tree.pop("format") == FORMAT
            groups = {name: _group(group) for name, group in tree.pop("groups").items()}
            return cls(groups=groups, **tree)
        except (AssertionError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise ValueError(f"{path} is no result of the bench: {error}") from error


def _group(tree: dict[str, Any]) -> GroupResult:
    entries = {
        name: Entry({int(n): figures for n, figures in entry["repeats"].items()})
        for name, entry in tree.pop("entries").items()
    }
    ratios = {name: Related(**ratio) for name, ratio in tree.pop("ratios").items()}
    return GroupResult(entries=entries, ratios=ratios, **tree)
