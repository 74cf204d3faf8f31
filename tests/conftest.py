"""What holds for the whole test suite: it tests what is written, not what was compiled from it."""

import os

import pytest

os.environ.setdefault("DECMESH_INTERPRETED", "1")
"""For the processes that tests start as well. The test of what is compiled says 0."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--rewrite-transcripts",
        action="store_true",
        help="write tests/transcripts/*.txt anew from what happens now; look at the difference",
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what can be known of a test from where it lies and how it is made."""
    for item in items:
        if "system" in item.path.parts:
            item.add_marker("processes")
        if getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
            item.add_marker("sampling")
