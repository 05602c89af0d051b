"""Means over a piece of time, against the same in fifty digits: on both sides of where a series takes over."""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import factorial

import pytest

from rw_ekf.model.averages import phi_1, phi_1_slope, sinc

_POINTS = [0.0, 1e-12, 1e-6, 1e-3, 0.0199999, 0.0200001, 0.1, 0.2999999, 0.3000001, 1.0, 3.0, 20.0]
_TERMS = 120


def series(x: float, *, alternating: bool, by: int, first: int, slope: bool = False) -> Decimal:
    """Sum of x^(by k) / (by k + first)!, its signs alternating, or its derivative."""
    with localcontext() as context:
        context.prec = 80
        total, at = Decimal(0), Decimal(x)
        for k in range(_TERMS):
            power = by * k
            sign = -1 if alternating and k % 2 else 1
            if not slope:
                total += sign * at**power / factorial(power + first) if power else Decimal(1) / factorial(first)
            elif power:
                total += sign * power * (at ** (power - 1) if power > 1 else Decimal(1)) / factorial(power + first)
        return total


@pytest.mark.parametrize("x", [*_POINTS, *(-x for x in _POINTS)])
def test_mean_of_a_decay_and_its_slope(x: float) -> None:
    """(1 - exp(-x))/x to rounding, its slope to what the difference of near numbers leaves of it."""
    assert phi_1(x) == pytest.approx(float(series(x, alternating=True, by=1, first=1)), rel=1e-13)
    slope = float(series(x, alternating=True, by=1, first=1, slope=True))
    assert phi_1_slope(x) == pytest.approx(slope, rel=3e-12)


@pytest.mark.parametrize("half", [*_POINTS, *(-x for x in _POINTS)])
def test_mean_of_a_sine(half: float) -> None:
    """sin(half)/half to rounding."""
    assert sinc(half) == pytest.approx(float(series(half, alternating=True, by=2, first=1)), rel=1e-12, abs=1e-15)
