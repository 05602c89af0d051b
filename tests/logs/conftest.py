"""The record that the tests of foreign logs write down in many ways."""

from __future__ import annotations

import pytest

import rw_ekf


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """60 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=60.0, seed=6)
