"""Numbers in words: as many digits as the standard deviation allows."""

from __future__ import annotations

import math

import pytest

from rw_ekf.numbers import plus_minus


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (3.0234, 0.1441, "3.02 +- 0.14"),
        (3.0234, 0.51, "3.0 +- 0.5"),
        (-523.4, 21.0, "-523 +- 21"),
        (1.2345e-6, 3.0e-8, "(1.23 +- 0.03)e-6"),
        (2.5e7, 1.4e6, "(2.50 +- 0.14)e+7"),
        (0.0, 0.2, "0.0 +- 0.2"),
        (12.3456789, 1.0e-9, "12.3457 +- 1e-09"),
        (0.3, 30.0, "0 +- 30"),
        (1.5, 0.0, "1.5"),
        (1.5, math.nan, "1.5"),
        (math.inf, 1.0, "inf"),
    ],
)
def test_plus_minus(value: float, std: float, text: str) -> None:
    """One digit of the standard deviation, two where it begins with 1, and the value as far as that."""
    assert plus_minus(value, std) == text
