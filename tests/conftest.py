"""Options of the whole suite."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """--refresh-golden: write the golden numbers anew; in a commit of its own that says why."""
    parser.addoption("--refresh-golden", action="store_true", help="write tests/golden/ anew instead of comparing")
