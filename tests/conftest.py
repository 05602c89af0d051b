"""Options of the whole suite."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """--refresh-golden: write the golden numbers anew; in a commit of its own that says why."""
    parser.addoption("--refresh-golden", action="store_true", help="write tests/golden/ anew instead of comparing")


@pytest.fixture(scope="session", autouse=True)
def _compiled_ahead() -> None:
    """Tests begin with a warm cache, as every use but the first does; what a cold one says has tests of its own."""
    from rw_ekf.compile_ahead import DIAGNOSIS, cold, compile_in_children

    missing = cold(DIAGNOSIS)
    if missing:
        compile_in_children(missing, lambda done: None)
