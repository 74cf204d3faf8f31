"""The keys of `summary.json`, from the types that it is made of."""

from deploy.generated.markdown import attribute_docs, table
from deploy.generated.scenario_keys import unit
from deploy.outcome.foot_margin import FootMargin
from deploy.outcome.indices import Elections, Energy, Indices
from deploy.outcome.realtime_summary import BoardKeys, RealtimeKeys
from deploy.outcome.summary import SummaryKeys

PARTS: dict[str, type] = {
    "": SummaryKeys,
    "indices.TS": Indices,
    "energy_j": Energy,
    "consensus": Elections,
    "foot": FootMargin,
    "realtime": RealtimeKeys,
    "realtime.boards.knee": BoardKeys,
}
"""Where in the file which type is; TS and knee stand for any variable and joint."""


def summary_keys() -> str:
    """Give a heading and a table for each object of the file."""
    return "\n\n".join(_section(path, kind) for path, kind in PARTS.items())


def _section(path: str, kind: type) -> str:
    docs = attribute_docs(kind)
    assert docs.keys() == kind.__annotations__.keys(), f"a key of {kind} is not explained"
    # What is None in the code is null in the file.
    rows = [(f"`{key}`", unit(key), docs[key].replace("None", "null")) for key in docs]
    heading = f"### `{path}`\n\n" if path else ""
    return heading + table(("key", "unit", "meaning"), rows)
