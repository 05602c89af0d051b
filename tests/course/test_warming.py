"""The law of a wheel's temperature: its few unknowns between bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from rw_ekf.course.warming import _within_bounds


@pytest.mark.parametrize("seed", range(20))
def test_the_solution_between_bounds_is_that_of_the_library(seed: int) -> None:
    """Least squares with none to four bounds met, against scipy's, whose import takes longer than the whole fit."""
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(30, 5)), rng.normal(size=30)
    low, high = np.array([-np.inf, -np.inf, 0.05, 0.0, 0.0]), np.array([np.inf, np.inf, 0.1, np.inf, np.inf])
    found = _within_bounds(A, b, low, high)
    theirs = lsq_linear(A, b, bounds=(low, high), tol=1e-12).x
    np.testing.assert_allclose(found, theirs, atol=1e-6)
