"""Canonical JSON: the one way to write tables down of which a digest is taken.

Keys sorted, no spaces, ASCII, the shortest floats that read back as the same; never NaN. By the
standard library and not by msgspec, which writes 1e-5 where all digests have been of 1e-05.
"""

import json
from typing import Any


def canonical_json(tables: dict[str, Any]) -> bytes:
    """Write tables down. Raises ValueError for a float that is no number."""
    text = json.dumps(tables, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode()
