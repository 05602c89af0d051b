"""Options of the whole suite."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """--refresh-golden: write the golden numbers anew; in a commit of its own that says why."""
    parser.addoption("--refresh-golden", action="store_true", help="write tests/golden/ anew instead of comparing")


# Slow tests of the diagnosis and the watch that were not yet run as a whole on the last version: they run and are
# reported, but do not hold a build back. Each leaves this list with its first complete run (docs/diagnosis-proof.md).
NOT_YET_COUNTED = ("test_walk.py", "test_proof.py", "test_rough_logs.py", "test_effects_in_filter.py", "test_diagnose_",
                   "tests/watch/", "tests/diagnosis/")  # fmt: skip


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let the slow ones among them fail without failing the run."""
    for item in items:
        new = any(name in str(item.path) for name in NOT_YET_COUNTED)
        if new and (
            item.get_closest_marker("slow") or "rough_logs" in str(item.path) or "test_diagnose_" in str(item.path)
        ):
            item.add_marker(pytest.mark.xfail(strict=False, reason="not yet run as a whole on this version"))
