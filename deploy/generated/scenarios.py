"""The table of the scenarios that come with decmesh."""

from deploy.generated.markdown import table
from deploy.scenario_file.load import available, load


def scenarios() -> str:
    """Give every scenario with its own description."""
    rows = [(f"`{name}`", load(name).description) for name in available()]
    return table(("scenario", "what it shows"), rows)
