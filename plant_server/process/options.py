"""How a plant process is to behave, as its command line says."""

from pathlib import Path
from typing import NamedTuple


class Options(NamedTuple):
    """How a plant process is to behave."""

    spool: Path | None
    """Where to record, if anywhere."""
    progress: bool
    """Whether a launcher reads what is said on standard output."""
    patience_s: float | None
    """How long a silent board is waited for; None: for ever. Realtime waits for nobody."""
    pace: float | None = None
    """Seconds of the body in a second of the wall; None: what the scenario says."""
