"""A law without a formula, read: the formula that made it is found in its band, and none where none comes near."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.verdict.formulas_in_band import readings
from rw_ekf.model.law import Law, Quantity

KNOTS = np.linspace(0.0, 100.0, 66)


def law_through(curve: Float64Array, quantity: Quantity, sigma: float) -> tuple[Law, tuple[float, ...], Float64Array]:
    """A law of fourteen smooth functions fitted to a curve on the knots whose values are known to sigma."""
    functions = np.array([np.cos(np.pi * k * KNOTS / 100.0) for k in range(1, 15)])
    information = functions @ functions.T / sigma**2
    noise = sigma * np.random.default_rng(5).standard_normal(KNOTS.size)
    values = np.linalg.solve(information, functions @ (curve + noise - np.mean(curve)) / sigma**2)
    law = Law(quantity, "motor_gain", 0.0, 100.0, tuple(map(tuple, functions.tolist())), (1.0,) * 14, "tank_K")
    return law, tuple(values.tolist()), np.linalg.inv(information)


@pytest.mark.parametrize(
    ("curve", "text"),
    [
        (0.02 * (KNOTS - 50.0), "(tank_K - 50)"),
        (0.5 * np.tanh((KNOTS - 50.0) / 12.0), "tanh((tank_K - 50)/1"),
        (0.4 * np.sin(2.0 * np.pi * KNOTS / 40.0), "sin(2 pi tank_K/40"),
        (0.7 * np.exp(-KNOTS / 23.0), "exp(-tank_K/"),
    ],
)
def test_the_formula_that_made_a_law_is_the_likeliest(curve: Float64Array, text: str) -> None:
    """A line, a step, a wave, an exponential: by its own family and numbers, ahead of all others."""
    first = readings(*law_through(curve, "column", 0.02))[0]
    assert text in first.text
    assert first.probability > 0.5


def test_what_no_formula_comes_near_is_left_a_curve() -> None:
    """Two bumps on a slope, known well, are none of the families."""
    curve = np.exp(-(((KNOTS - 20.0) / 6.0) ** 2)) - 0.8 * np.exp(-(((KNOTS - 70.0) / 9.0) ** 2)) + 0.01 * KNOTS
    assert readings(*law_through(curve, "column", 0.005)) == []


def test_one_that_is_hardly_known_may_be_several() -> None:
    """Their probabilities add up to one at most, the likeliest first."""
    found = readings(*law_through(0.02 * (KNOTS - 50.0), "column", 2.0))
    chances = [formula.probability for formula in found]
    assert len(found) > 1
    assert sum(chances) <= 1.0 + 1e-9
    assert chances == sorted(chances, reverse=True)
